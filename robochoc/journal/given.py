"""The problem that robots get when a run begins: a team as an event, for replays, and back.

Robots travel as the XML files that they could have come from. What such a file cannot say stands beside them: the
priority order, variables that neighbours see though nothing in the robot's own file says so, and domains that a
scenario has emptied. Two things are not kept, as no robot looks at them: what definitions and domains are called
(where two of a file have one name, one gets another), and which lines of which file they came from.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import msgspec
from msgspec import UNSET, UnsetType

from robochoc.formats import InvalidInputError, robot_in, robot_xml
from robochoc.formats.names import is_name
from robochoc.journal.events import Given
from robochoc.model.cost_units import PLAIN_COSTS, Cost, CostUnits
from robochoc.model.costs import flat_units
from robochoc.model.problem import INFINITE, Constraint, Relation, Robot, Team, Variable
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, RunParameters
from robochoc.solver.explanation import Invalidated
from robochoc.system.errors import RobochocError

NOTHING_INVALIDATED = Invalidated(frozenset(), frozenset())
_STAND_IN = (range(1),)
"""The domain that is written for an empty one, which a file cannot have."""


class GivenProblemError(RobochocError, ValueError):
    """The event with the robots' problems does not contain a valid team."""


class TeamWriter:
    """Writes what robots are given. Of their files only those that have changed since the last time."""

    def __init__(self) -> None:
        self._robots: dict[str, Robot] = {}
        self._files: dict[str, str] = {}

    def given(
        self,
        team: Team,
        parameters: RunParameters = DEFAULT_PARAMETERS,
        invalidated: Invalidated = NOTHING_INVALIDATED,
        *,
        fresh: Collection[str] = (),
        quiet: bool = True,
    ) -> Given:
        """Return the event with the problem of `team`, in its order. `why`: the reason if it cannot be written."""
        event = Given(
            t=0,
            order=team.order,
            robots={},
            seed=parameters.seed,
            settings=dict(parameters.settings),
            aside=parameters.withdrawal_cost,
            fresh=tuple(sorted(fresh)),
            void_keys=tuple(sorted(invalidated.keys)),
            void_agents=tuple(sorted(invalidated.agents)),
            quiet=quiet,
            shown={robot.name: robot.shown for robot in team.robots if robot.shown},
            empty=tuple(name for name, variable in team.variables.items() if not variable.domain),
            told_in=_units(flat_units(team)),
        )
        try:
            files = {robot.name: self._file(robot) for robot in team.robots}
        except ValueError as error:
            return msgspec.structs.replace(event, why=str(error))
        news = {name: file for name, file in files.items() if self._files.get(name) != file}
        self._robots.update((robot.name, robot) for robot in team.robots)
        self._files.update(news)
        return msgspec.structs.replace(event, robots=news)

    def _file(self, robot: Robot) -> str:
        """Return the robot's file; an equal robot's is not written again."""
        if self._robots.get(robot.name) == robot:
            return self._files[robot.name]
        try:
            return robot_xml(_writable(robot)).decode()
        except ValueError as error:
            raise ValueError(f"{robot.name} cannot be written: {error}") from error


class TeamReader:
    """Reads what `TeamWriter` says, one event after the other."""

    def __init__(self, name: str = "") -> None:
        self._name = name
        self._robots: dict[str, Robot] = {}

    def team(self, given: Given) -> Team:
        """Return the team, in its order. Raises `GivenProblemError`."""
        if given.why:
            raise GivenProblemError(f"the robots' problems could not be written: {given.why}")
        for name, content in given.robots.items():
            try:
                self._robots[name] = robot_in(content.encode(), name)
            except (InvalidInputError, UnicodeEncodeError) as invalid:
                raise GivenProblemError(f"the problem of {name} cannot be read: {invalid}") from invalid
        missing = [name for name in given.order if name not in self._robots]
        if missing:
            raise GivenProblemError(f"the problem of {missing[0]} is missing")
        empty = set(given.empty)
        robots = tuple(_as_given(self._robots[name], given.shown.get(name, ()), empty) for name in given.order)
        if robots and given.told_in is not UNSET:
            robots = (replace(robots[0], user_units=CostUnits(*given.told_in)), *robots[1:])
        team = Team(self._name, robots)
        _check(team)
        return team


def _units(units: CostUnits) -> tuple[bool, int, int] | UnsetType:
    return UNSET if units == PLAIN_COSTS else (units.maximize, units.places, units.constant)


def run_parameters_of(given: Given) -> RunParameters:
    """Return the parameters of the run."""
    return RunParameters(given.seed, given.settings, given.aside)


def cost_in_user_units(given: Given | None, cost: float) -> Cost | float:
    """Return `cost`, as protocols count it, in the user's numbers, as far as `given` says how."""
    if given is None or given.told_in is UNSET:
        return cost
    units = CostUnits(*given.told_in)
    return units.in_user_units(-cost if units.maximize else cost)


def invalidated_of(given: Given) -> Invalidated:
    """Return the invalidated parts of the previous epoch."""
    return Invalidated(frozenset(given.void_keys), frozenset(given.void_agents))


def _as_given(robot: Robot, shown: tuple[str, ...], empty: Collection[str]) -> Robot:
    """Return `robot` with what its file cannot say."""
    if not (shown or any(variable.name in empty for variable in robot.variables)):
        return robot
    return replace(robot, shown=shown, variables=_with_domain(robot, empty, ()))


def _with_domain(robot: Robot, names: Collection[str], ranges: tuple[range, ...]) -> tuple[Variable, ...]:
    """Return the variables of `robot`, those in `names` with the domain `ranges`."""
    return tuple(
        replace(variable, domain=replace(variable.domain, ranges=ranges)) if variable.name in names else variable
        for variable in robot.variables
    )


# What a file can say


def _writable(robot: Robot) -> Robot:
    """Return `robot` as a file can say it: no domain is empty. Raises `ValueError`."""
    for name in (robot.name, *(variable.name for variable in robot.variables)):
        if not is_name(name):
            raise ValueError(f"{name!r} cannot be a name in a file")
    empty = [variable.name for variable in robot.variables if not variable.domain]
    if empty:
        robot = replace(robot, variables=_with_domain(robot, empty, _STAND_IN))
    for constraint in robot.constraints():
        _check_costs(constraint)
    return robot


def _check_costs(constraint: Constraint) -> None:
    """Raise `ValueError` for a cost that comes back from a file as another number: 5.0 as 5, which is sent shorter."""
    definition = constraint.definition
    costs = (*definition.costs, definition.default_cost) if isinstance(definition, Relation) else (constraint.cost,)
    for cost in costs:
        if type(cost) is float and cost != INFINITE:
            raise ValueError(f"the cost {cost} of {constraint.name} is not an integer")


# Events of unknown origin


def _check(team: Team) -> None:
    """Raise `GivenProblemError` where files that are right by themselves do not go together."""
    if len(team.order) != len(set(team.order)):
        raise GivenProblemError("a robot stands twice in the order")
    if len(team.owner) != sum(len(robot.variables) for robot in team.robots):
        raise GivenProblemError("a variable belongs to two robots")
    for robot in team.robots:
        names = [*(one.name for one in robot.parents), *(one.name for one in robot.children)]
        names += [name for constraint in robot.constraints() for name in constraint.variables]
        unknown = [name for name in names if name not in team and name not in team.owner]
        if unknown:
            raise GivenProblemError(f"{robot.name} was given something on {unknown[0]}, which is not in the team")
