"""Teams and robots with their compiled domains: the one can only be had together with the other.

What the values of a robot mean depends on what it shows its neighbours, and that on the links of its team: the files'
team, the same team turned to another priority order, and what is left of it after a change have other domains. So
domains are never passed around alone. A `CompiledTeam` has the domains of exactly its team.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from robochoc.model.problem import Robot, Team
from robochoc.solver.domain import CompiledDomain, compile_domain

CompileRobot = Callable[[Robot], CompiledDomain]
"""Computes a robot's compiled domain. `compile_domain` does so without a solver, `solver/compile.py` with one."""


@dataclass(frozen=True, init=False)
class CompiledRobot:
    """A robot and its compiled domain."""

    robot: Robot
    domain: CompiledDomain

    def __init__(self, robot: Robot, compile_robot: CompileRobot = compile_domain) -> None:
        """Compile `robot`. Raises what `compile_robot` raises."""
        object.__setattr__(self, "robot", robot)
        object.__setattr__(self, "domain", compile_robot(robot))

    def relinked(self, robot: Robot, compile_robot: CompileRobot = compile_domain) -> CompiledRobot:
        """Return `robot`, which is this one with other links. It is compiled anew only if its values are others."""
        same = _decisive(robot) == _decisive(self.robot)
        return CompiledRobot(robot, (lambda _: self.domain) if same else compile_robot)


@dataclass(frozen=True, init=False)
class CompiledTeam:
    """A team in the order that its robots work in, and the compiled robots, by name.

    `robots` are all of the team's, unless only some of them were asked for.
    """

    team: Team
    robots: Mapping[str, CompiledRobot]

    def __init__(
        self, team: Team, compile_robot: CompileRobot = compile_domain, only: Collection[str] | None = None
    ) -> None:
        """Compile the robots of `team`, or `only` those of these names. Raises what `compile_robot` raises."""
        named = [robot for robot in team.robots if only is None or robot.name in only]
        robots = {robot.name: CompiledRobot(robot, compile_robot) for robot in named}
        object.__setattr__(self, "team", team)
        object.__setattr__(self, "robots", MappingProxyType(robots))

    def __getitem__(self, name: str) -> CompiledDomain:
        """Return the compiled domain of the robot called `name`."""
        return self.robots[name].domain


def ensure_compiled(team: Team | CompiledTeam) -> CompiledTeam:
    """Return `team`, compiled without a solver if it is not compiled yet. Raises as `compile_domain` does."""
    return team if isinstance(team, CompiledTeam) else CompiledTeam(team)


def _decisive(robot: Robot) -> tuple[object, ...]:
    """Return all of `robot` that its compiled domain depends on."""
    return robot.variables, robot.private, robot.interface
