"""The problem of one agent: its robot's file, and the common knowledge of all robots.

An agent receives nothing else, either in the simulator or in a separate process.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import NamedTuple

from robochoc.model.problem import ConstraintModel, Domain, Robot, Team
from robochoc.solver.compiled_domain import CompiledDomain
from robochoc.solver.compiled_team import CompiledRobot, CompiledTeam, ensure_compiled
from robochoc.solver.evaluations import SharedEvaluations
from robochoc.solver.explanation import KeyedConstraint, constraints_above
from robochoc.system.lazy_dataclass import dataclass

Interfaces = Mapping[str, tuple[str, ...]]
"""For each robot, by name, the interface variables, which its neighbours know."""

Links = Mapping[str, tuple[str, ...]]
"""The parents of each robot."""


_NO_SETTINGS: Mapping[str, str] = {}
"""A plain dictionary, because it is sent to other processes; never modified."""

StartValues = Mapping[str, int | None]
"""The values from which a search begins, by variable; None: the variable's robot withdraws."""

NO_START: StartValues = {}
"""A plain dictionary, like `_NO_SETTINGS`."""


class RunParameters(NamedTuple):
    """The parameters of a run, the same for all robots except for `start`.

    Attributes:
        seed: The seed of the robots' random numbers.
        settings: The protocol's settings, in the user's notation.
        withdrawal_cost: The cost of withdrawing a robot of weight 1, whose constraints, private ones included, then no
            longer apply. None: robots must not withdraw.
        message_loss: The probability that a robot drops a received message, as if it had been lost.
        start: The start values that are known. A robot receives only the values of its own interface variables.
        upper_bound: The cost of the assignment `start`, in normalised costs (`model/costs.py`) and including withdrawal
            costs: only lower costs are of interest (None: unknown, or the protocol cannot use it).
    """

    seed: int = 0
    settings: Mapping[str, str] = _NO_SETTINGS
    withdrawal_cost: int | float | None = None
    message_loss: float = 0.0
    start: StartValues = NO_START
    upper_bound: int | float | None = None


DEFAULT_PARAMETERS = RunParameters()


@dataclass(frozen=True)
class TeamKnowledge:
    """The common knowledge of all robots in a team. All robots in a process, and in its forks, share one object.

    Attributes:
        order: The names of all robots in priority order, the highest first.
        interfaces: The interface variables of all robots.
        domains: The declared domains of all interface variables.
        links: The parents of each robot, for protocols on a pseudo-tree.
        rank: The position of each robot in the order. Other processes recompute it.
        owners: The robot of each interface variable. Other processes recompute it.
        evaluations: The computed costs of equal constraints (`solver/evaluations.py`). Empty in other processes.
    """

    order: tuple[str, ...]
    interfaces: Interfaces
    domains: Mapping[str, Domain]
    links: Links | None = None
    rank: Mapping[str, int] = field(init=False, compare=False, repr=False)
    owners: Mapping[str, str] = field(init=False, compare=False, repr=False)
    evaluations: SharedEvaluations = field(default_factory=SharedEvaluations, init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Compute `rank` and `owners` once for all robots: computing them for each robot would take quadratic time."""
        object.__setattr__(self, "rank", {name: place for place, name in enumerate(self.order)})
        owners = {variable: robot for robot, shown in self.interfaces.items() for variable in shown}
        object.__setattr__(self, "owners", owners)

    def __reduce__(self) -> tuple[type[TeamKnowledge], tuple[object, ...]]:
        """Pickle without the computed attributes."""
        return TeamKnowledge, (self.order, self.interfaces, dict(self.domains), self.links)


class AgentProblem(NamedTuple):
    """The problem of one agent: its robot's knowledge when the search begins.

    Attributes:
        own: The robot, with its compiled domain.
        known: The common knowledge of all robots.
        copies: Totally known constraints of lower robots on variables of this robot, for protocols in which all robots
            in a scope know the constraint.
        pkc_holders: The parents with a part of a partially known constraint with this robot. Both robots know that the
            constraint exists. Neither robot knows the other's part.
        parameters: The parameters of the run.
    """

    own: CompiledRobot
    known: TeamKnowledge
    copies: tuple[KeyedConstraint, ...] = ()
    pkc_holders: tuple[str, ...] = ()
    parameters: RunParameters = DEFAULT_PARAMETERS

    @property
    def order(self) -> tuple[str, ...]:
        """The names of all robots in priority order, the highest first."""
        return self.known.order

    @property
    def interfaces(self) -> Interfaces:
        """The interface variables of all robots."""
        return self.known.interfaces

    @property
    def robot(self) -> Robot:
        """The robot, as described in its file."""
        return self.own.robot

    @property
    def domain(self) -> CompiledDomain:
        """The compiled domain of the robot."""
        return self.own.domain


class AgentProblems:
    """The problems of the agents in a team: their common parts are computed once.

    Args:
        team: The team.
        parameters: The parameters of the run.
        shared_scopes: True if every robot in a constraint's scope knows the constraint.
        tree: True if all robots know the parents of each robot.
    """

    def __init__(
        self,
        team: Team,
        parameters: RunParameters = DEFAULT_PARAMETERS,
        *,
        shared_scopes: bool = False,
        tree: bool = False,
    ) -> None:
        shown = {robot.name: robot.interface for robot in team.robots}
        domains = {name: team.variables[name].domain for names in shown.values() for name in names}
        links = {robot.name: tuple(parent.name for parent in robot.parents) for robot in team.robots} if tree else None
        self._everyone = TeamKnowledge(tuple(team.order), shown, domains, links)
        self._parameters = parameters
        self._copies: dict[str, list[KeyedConstraint]] = {robot.name: [] for robot in team.robots}
        if shared_scopes:
            for robot in team.robots:
                for one in constraints_above(robot):
                    for owner in {team.owner[name] for name in one.constraint.variables} - {robot.name}:
                        if one.constraint.model != ConstraintModel.PKC:
                            self._copies[owner].append(one)
        self._pkc_holders: dict[str, list[str]] = {robot.name: [] for robot in team.robots}
        for robot in team.robots:
            for child in robot.children:
                if child.constraints:
                    self._pkc_holders[child.name].append(robot.name)

    def problem(self, own: CompiledRobot) -> AgentProblem:
        """Return the problem of the agent with the robot `own`."""
        name = own.robot.name
        copies, pkc_holders = tuple(self._copies[name]), tuple(self._pkc_holders[name])
        parameters = self._parameters
        if parameters.start:
            parameters = parameters._replace(start=only_values_of(own.robot, parameters.start))
        return AgentProblem(own, self._everyone, copies, pkc_holders, parameters)


def only_values_of(robot: Robot, start: StartValues) -> StartValues:
    """Return the start values of the robot's interface variables."""
    return {name: start[name] for name in robot.interface if name in start}


def agent_problems(
    team: Team | CompiledTeam,
    parameters: RunParameters = DEFAULT_PARAMETERS,
    *,
    shared_scopes: bool = False,
    tree: bool = False,
) -> dict[str, AgentProblem]:
    """Return the problem of each compiled agent in `team`, by the robot's name, in priority order (`AgentProblems`)."""
    compiled = ensure_compiled(team)
    problems = AgentProblems(compiled.team, parameters, shared_scopes=shared_scopes, tree=tree)
    return {name: problems.problem(own) for name, own in compiled.robots.items()}
