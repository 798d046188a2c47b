"""Teams and robots together with their compiled domains.

The values of a robot depend on its interface variables, and these depend on the links in its team: the team in the
files, the same team in another priority order, and the team after a change have different domains. So domains are never
passed around alone. A `CompiledTeam` has the domains of exactly its team.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType

from robochoc.model.problem import Robot, Team
from robochoc.solver.compiled_domain import CompiledDomain, compile_domain
from robochoc.system.lazy_dataclass import dataclass

CompileRobot = Callable[[Robot], CompiledDomain]
"""Computes a robot's compiled domain: `compile_domain` without a solver, `solver/compile.py` with one."""


@dataclass(frozen=True, init=False)
class CompiledRobot:
    """A robot and its compiled domain."""

    robot: Robot
    domain: CompiledDomain

    def __init__(self, robot: Robot, compile_robot: CompileRobot = compile_domain) -> None:
        """Compile `robot`. Raises the errors of `compile_robot`."""
        object.__setattr__(self, "robot", robot)
        object.__setattr__(self, "domain", compile_robot(robot))

    def relinked(self, robot: Robot, compile_robot: CompileRobot = compile_domain) -> CompiledRobot:
        """Return `robot`, this robot with other links, compiled. It is recompiled only if its values differ."""
        same = _decisive(robot) == _decisive(self.robot)
        return CompiledRobot(robot, (lambda _: self.domain) if same else compile_robot)


@dataclass(frozen=True, init=False)
class CompiledTeam:
    """A team in its priority order, and its compiled robots by name.

    `robots` contains all robots in the team, unless `only` some were compiled.
    """

    team: Team
    robots: Mapping[str, CompiledRobot]

    def __init__(
        self, team: Team, compile_robot: CompileRobot = compile_domain, only: Collection[str] | None = None
    ) -> None:
        """Compile the robots in `team`, or `only` those with these names. Raises the errors of `compile_robot`."""
        named = [robot for robot in team.robots if only is None or robot.name in only]
        robots = {robot.name: CompiledRobot(robot, compile_robot) for robot in named}
        object.__setattr__(self, "team", team)
        object.__setattr__(self, "robots", MappingProxyType(robots))

    def __getitem__(self, name: str) -> CompiledDomain:
        """Return the compiled domain of the robot called `name`."""
        return self.robots[name].domain


def ensure_compiled(team: Team | CompiledTeam) -> CompiledTeam:
    """Return `team`, compiled without a solver if it is not compiled yet. Raises the errors of `compile_domain`."""
    return team if isinstance(team, CompiledTeam) else CompiledTeam(team)


def _decisive(robot: Robot) -> tuple[object, ...]:
    """Return the parts of `robot` that determine its compiled domain."""
    return robot.variables, robot.private, robot.interface
