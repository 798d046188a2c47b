"""Conversion of teams to `Given` events, which contain the robots' problems for replays, and back.

Robots are recorded as equivalent XML files. The event contains separately what a file cannot express: the priority
order, variables that neighbours see although the robot's file does not show it, and domains that a scenario has
emptied. Two facts are not recorded, because robots do not use them: the names of definitions and domains (duplicate
names in a file are changed), and their lines in the original files.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import msgspec
from msgspec import UNSET, UnsetType

from robochoc.formats import InvalidInputError, robot_in
from robochoc.formats.names import is_name
from robochoc.journal.events import Began, Given
from robochoc.model.cost_units import PLAIN_COSTS, Cost, CostUnits
from robochoc.model.costs import flat_units
from robochoc.model.problem import INFINITE, Constraint, Relation, Robot, Team, Variable
from robochoc.model.team_edits import on_intervals
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, RunParameters
from robochoc.solver.explanation import Invalidated
from robochoc.system.errors import RobochocError

NOTHING_INVALIDATED = Invalidated(frozenset(), frozenset())
_PLACEHOLDER = (range(1),)
"""The domain written instead of an empty domain, which a file cannot contain."""


class GivenProblemError(RobochocError, ValueError):
    """Raised if the event with the robots' problems does not contain a valid team."""


class TeamWriter:
    """Writes `Given` events. Each event contains only the robots' files that have changed since the previous event."""

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
        """Return the event with the problem of `team`. If it cannot be written, `why` is the reason."""
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
            any_step=any(one.domain.real and one.domain.real.any_step for one in team.variables.values()) or UNSET,
        )
        try:
            files = {robot.name: self._file(robot) for robot in team.robots}
        except ValueError as error:
            return msgspec.structs.replace(event, why=str(error))
        changed = {name: file for name, file in files.items() if self._files.get(name) != file}
        self._robots.update((robot.name, robot) for robot in team.robots)
        self._files.update(changed)
        return msgspec.structs.replace(event, robots=changed)

    def _file(self, robot: Robot) -> str:
        """Return the robot's file. If the robot has not changed, the previous file is reused."""
        if self._robots.get(robot.name) == robot:
            return self._files[robot.name]
        from robochoc.formats import robot_xml  # noqa: PLC0415 - start-up: most runs have no journal

        try:
            return robot_xml(_writable(robot)).decode()
        except ValueError as error:
            raise ValueError(f"{robot.name} cannot be written: {error}") from error


class TeamReader:
    """Reads the events of a `TeamWriter`, in the order in which they were written."""

    def __init__(self, name: str = "") -> None:
        self._name = name
        self._robots: dict[str, Robot] = {}

    def team(self, given: Given) -> Team:
        """Return the team after the next event. Raises `GivenProblemError`."""
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
        if given.any_step is True:
            team = on_intervals(team)
        _check(team)
        return team


def _units(units: CostUnits) -> tuple[bool, int, int] | UnsetType:
    return UNSET if units == PLAIN_COSTS else (units.maximize, units.places, units.constant)


def run_parameters_of(given: Given) -> RunParameters:
    """Return the parameters of the run, without its start."""
    return RunParameters(given.seed, given.settings, given.aside)


def start_fields(parameters: RunParameters) -> dict[str, Any]:
    """Return the fields of `Began` with the start of a run, if it has one."""
    fields: dict[str, Any] = {"start": dict(parameters.start)} if parameters.start else {}
    return fields if parameters.upper_bound is None else fields | {"upper_bound": parameters.upper_bound}


def with_start(parameters: RunParameters, began: Began | None) -> RunParameters:
    """Return `parameters` with the start of the run that `began`."""
    if began is None or began.start is UNSET:
        return parameters
    bound = None if began.upper_bound is UNSET else began.upper_bound
    return parameters._replace(start=began.start, upper_bound=bound)


def cost_in_user_units(given: Given | None, cost: float) -> Cost | float:
    """Convert the cost of a protocol to the user's units, if `given` contains them."""
    if given is None or given.told_in is UNSET:
        return cost
    units = CostUnits(*given.told_in)
    return units.in_user_units(-cost if units.maximize else cost)


def invalidated_of(given: Given) -> Invalidated:
    """Return the invalidated parts of the previous epoch."""
    return Invalidated(frozenset(given.void_keys), frozenset(given.void_agents))


def _as_given(robot: Robot, shown: tuple[str, ...], empty: Collection[str]) -> Robot:
    """Return `robot` with the properties that its file cannot express."""
    if not (shown or any(variable.name in empty for variable in robot.variables)):
        return robot
    return replace(robot, shown=shown, variables=_with_domain(robot, empty, ()))


def _with_domain(robot: Robot, names: Collection[str], ranges: tuple[range, ...]) -> tuple[Variable, ...]:
    """Return the variables of `robot`. Those in `names` have the domain `ranges`."""
    return tuple(
        replace(variable, domain=replace(variable.domain, ranges=ranges)) if variable.name in names else variable
        for variable in robot.variables
    )


# Conversion to a file


def _writable(robot: Robot) -> Robot:
    """Return `robot` without empty domains, as files require. Raises `ValueError` if no file can express the robot."""
    for name in (robot.name, *(variable.name for variable in robot.variables)):
        if not is_name(name):
            raise ValueError(f"{name!r} cannot be a name in a file")
    empty = [variable.name for variable in robot.variables if not variable.domain]
    if empty:
        robot = replace(robot, variables=_with_domain(robot, empty, _PLACEHOLDER))
    for constraint in robot.constraints():
        _check_costs(constraint)
    return robot


def _check_costs(constraint: Constraint) -> None:
    """Raise `ValueError` for a cost that a file does not preserve: 5.0 is read as 5, which is shorter in messages."""
    definition = constraint.definition
    costs = (*definition.costs, definition.default_cost) if isinstance(definition, Relation) else (constraint.cost,)
    for cost in costs:
        if type(cost) is float and cost != INFINITE:
            raise ValueError(f"the cost {cost} of {constraint.name} is not an integer")


# Events of unknown origin


def _check(team: Team) -> None:
    """Raise `GivenProblemError` if the files, each valid by itself, are inconsistent."""
    if len(team.order) != len(set(team.order)):
        raise GivenProblemError("a robot occurs twice in the order")
    if len(team.owner) != sum(len(robot.variables) for robot in team.robots):
        raise GivenProblemError("a variable belongs to two robots")
    for robot in team.robots:
        names = [*(one.name for one in robot.parents), *(one.name for one in robot.children)]
        names += [name for constraint in robot.constraints() for name in constraint.variables]
        unknown = [name for name in names if name not in team and name not in team.owner]
        if unknown:
            raise GivenProblemError(f"the problem of {robot.name} contains {unknown[0]}, which is not in the team")
