"""The problem that one agent is given: its robot's file, and what all robots know of each other.

An agent gets nothing else, neither in the simulator nor in a process of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from robochoc.model.problem import ConstraintModel, Domain, Robot, Team
from robochoc.solver.compiled_team import CompiledRobot, CompiledTeam, ensure_compiled
from robochoc.solver.domain import CompiledDomain
from robochoc.solver.explanation import KeyedConstraint, held_above

Interfaces = Mapping[str, tuple[str, ...]]
"""The variables that each robot shows to its neighbours, by the robot's name."""

Links = Mapping[str, tuple[str, ...]]
"""The parents of each robot."""


_NO_SETTINGS: Mapping[str, str] = {}
"""A plain dictionary, as it has to travel to other processes; nobody writes to it."""


class RunParameters(NamedTuple):
    """The parameters of a run, the same for all robots.

    Attributes:
        seed: Robots draw their random numbers from it.
        settings: The protocol's settings, as the user wrote them.
        withdrawal_cost: The cost of withdrawing a robot of weight 1. The constraints of a withdrawn robot, its private
            ones too, no longer apply. None: robots must not withdraw.
        message_loss: The probability with which a robot drops a message that it receives, as if it had been lost.
    """

    seed: int = 0
    settings: Mapping[str, str] = _NO_SETTINGS
    withdrawal_cost: int | float | None = None
    message_loss: float = 0.0


DEFAULT_PARAMETERS = RunParameters()


@dataclass(frozen=True)
class TeamKnowledge:
    """What all robots of a team know of each other. One object serves all robots of a process, and those forked of it.

    Attributes:
        order: The names of all robots in priority order, the highest first.
        interfaces: The interface variables of all robots.
        domains: The declared domains of all interface variables.
        links: The parents of each robot. For protocols that work on a pseudo-tree.
        rank: The place of each robot in the order. Not sent to other processes: they make it anew.
        owners: The robot of each interface variable. Not sent either.
    """

    order: tuple[str, ...]
    interfaces: Interfaces
    domains: Mapping[str, Domain]
    links: Links | None = None
    rank: Mapping[str, int] = field(init=False, compare=False, repr=False)
    owners: Mapping[str, str] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Look up both at once for all robots, and not for each: that would take the square of the time."""
        object.__setattr__(self, "rank", {name: place for place, name in enumerate(self.order)})
        owners = {variable: robot for robot, shown in self.interfaces.items() for variable in shown}
        object.__setattr__(self, "owners", owners)

    def __reduce__(self) -> tuple[type[TeamKnowledge], tuple[object, ...]]:
        """Pickle without what can be made anew."""
        return TeamKnowledge, (self.order, self.interfaces, dict(self.domains), self.links)


class AgentProblem(NamedTuple):
    """The problem of one agent: the knowledge of its robot when the search begins.

    Attributes:
        own: The robot itself, with its compiled domain.
        known: What all robots know of each other.
        copies: The totally known constraints on its variables that lower robots hold. For protocols in which all
            robots of a scope know a constraint.
        pkc_holders: The parents that hold a part of a partially known constraint with this robot. Both sides know
            that there is such a constraint. Neither knows the other's part.
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
        """The robot itself, as its file says."""
        return self.own.robot

    @property
    def domain(self) -> CompiledDomain:
        """Its compiled domain."""
        return self.own.domain


def agent_problems(
    team: Team | CompiledTeam,
    parameters: RunParameters = DEFAULT_PARAMETERS,
    *,
    shared_scopes: bool = False,
    tree: bool = False,
) -> dict[str, AgentProblem]:
    """Return what each agent of `team` is given, by the robot's name, in priority order.

    Args:
        team: The team. Only robots that are compiled get a problem.
        parameters: The parameters of the run.
        shared_scopes: Whether every robot of a constraint's scope knows the constraint.
        tree: Whether all robots know the parents of each robot.
    """
    compiled = ensure_compiled(team)
    team = compiled.team
    shown = {robot.name: robot.interface for robot in team.robots}
    domains = {name: team.variables[name].domain for names in shown.values() for name in names}
    links = {robot.name: tuple(parent.name for parent in robot.parents) for robot in team.robots} if tree else None
    everyone = TeamKnowledge(tuple(team.order), shown, domains, links)
    copies: dict[str, list[KeyedConstraint]] = {robot.name: [] for robot in team.robots}
    if shared_scopes:
        for robot in team.robots:
            for one in held_above(robot):
                for owner in {team.owner[name] for name in one.constraint.variables} - {robot.name}:
                    if one.constraint.model != ConstraintModel.PKC:
                        copies[owner].append(one)
    pkc_holders: dict[str, list[str]] = {robot.name: [] for robot in team.robots}
    for robot in team.robots:
        for child in robot.children:
            if child.constraints:
                pkc_holders[child.name].append(robot.name)
    return {
        name: AgentProblem(own, everyone, tuple(copies[name]), tuple(pkc_holders[name]), parameters)
        for name, own in compiled.robots.items()
    }
