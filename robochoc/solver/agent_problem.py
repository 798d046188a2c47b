"""A robot's part of the team's problem: its own file, and what all robots know of each other.

This is all that reaches a robot, be it an object in the simulator or a process of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from robochoc.model.problem import ConstraintModel, Domain, Robot, Team
from robochoc.solver.compiled_team import CompiledRobot, CompiledTeam, as_compiled
from robochoc.solver.domain import CompiledDomain
from robochoc.solver.explanation import Known, held

Interfaces = Mapping[str, tuple[str, ...]]
"""The variables that each robot shows to its neighbours, by the robot's name."""

Links = Mapping[str, tuple[str, ...]]
"""The parents of each robot."""


class RunParameters(NamedTuple):
    """What all robots of a run are told beside the problem.

    `seed` is what their chance is drawn from, `settings` are the protocol's, as they were given. `aside` is what it
    costs that a robot of weight 1 steps aside (None: nobody may); then its constraints, its private ones too, fall
    away.
    """

    seed: int = 0
    settings: Mapping[str, str] = MappingProxyType({})
    aside: float | None = None


NO_BRIEF = RunParameters()


class AgentProblem(NamedTuple):
    """What one robot knows when the search begins.

    `own` is the robot itself with its compiled domain. `order`, `interfaces` and the declared `domains` of interface
    variables are common knowledge. `copies` are the totally known constraints over its
    variables that lower robots hold, for protocols in which all robots of a scope have to know them. `links` is
    for protocols that work on a pseudo-tree. `secretive` are the parents that hold parts of partially known
    constraints towards this robot: that there is such a constraint both sides know, the parts they do not.
    `brief` is what all robots are told; whoever may step aside does so at the `brief.aside` times its weight.
    """

    own: CompiledRobot
    order: Sequence[str]
    interfaces: Interfaces
    copies: tuple[Known, ...] = ()
    domains: Mapping[str, Domain] = MappingProxyType({})
    links: Links | None = None
    secretive: tuple[str, ...] = ()
    brief: RunParameters = NO_BRIEF

    @property
    def robot(self) -> Robot:
        """The robot itself, as its file says."""
        return self.own.robot

    @property
    def domain(self) -> CompiledDomain:
        """Its compiled domain."""
        return self.own.domain


def agent_problems(
    team: Team | CompiledTeam, brief: RunParameters = NO_BRIEF, *, shared_scopes: bool = False, tree: bool = False
) -> dict[str, AgentProblem]:
    """Return the part of each robot of `team` that is compiled, in priority order.

    `shared_scopes`: every robot of a constraint's scope knows it. `tree`: all know who is whose parent.
    """
    compiled = as_compiled(team)
    team = compiled.team
    shown = {robot.name: robot.interface for robot in team.robots}
    known = {name: team.variables[name].domain for names in shown.values() for name in names}
    links = {robot.name: tuple(parent.name for parent in robot.parents) for robot in team.robots} if tree else None
    copies: dict[str, list[Known]] = {robot.name: [] for robot in team.robots}
    if shared_scopes:
        for robot in team.robots:
            for one in held(robot):
                for owner in {team.owner[name] for name in one.constraint.variables} - {robot.name}:
                    if one.constraint.model is not ConstraintModel.PKC:
                        copies[owner].append(one)
    secretive: dict[str, list[str]] = {robot.name: [] for robot in team.robots}
    for robot in team.robots:
        for child in robot.children:
            if child.constraints:
                secretive[child.name].append(robot.name)
    return {
        name: AgentProblem(own, team.order, shown, tuple(copies[name]), known, links, tuple(secretive[name]), brief)
        for name, own in compiled.robots.items()
    }
