"""The files of a team side by side: what the fourth layer's checks ask."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path

from robochoc.formats.robot import RobotFile
from robochoc.problem import CycleError, Robot, priority_order


class Role(StrEnum):
    """What a robot says that another is to it."""

    PARENT = "parent"
    CHILD = "child"

    @property
    def opposite(self) -> Role:
        """What the other says of the robot, if they agree."""
        return Role.CHILD if self is Role.PARENT else Role.PARENT


@dataclass(frozen=True)
class Entry:
    """A line of a robot's file that lists a neighbour."""

    robot: Robot
    other: str
    role: Role
    line: int


@dataclass(frozen=True)
class Members:
    """The robots of a team, as far as their own files can be read.

    `broken` names the robots whose files have mistakes of their own. They are there, but nothing is known of them:
    a check that would need them says nothing, so that one mistake is told once.
    """

    folder: Path
    files: Mapping[str, RobotFile]
    broken: frozenset[str]

    @property
    def robots(self) -> Iterator[Robot]:
        """The robots that could be read."""
        return (file.robot for file in self.files.values())

    @cached_property
    def entries(self) -> dict[tuple[str, str], Entry]:
        """Who lists whom, by the names of the two."""
        return {
            (robot.name, neighbour.name): Entry(robot, neighbour.name, role, neighbour.line)
            for robot in self.robots
            for role, neighbours in ((Role.PARENT, robot.parents), (Role.CHILD, robot.children))
            for neighbour in neighbours
        }

    def is_parent(self, parent: str, child: str) -> bool:
        """Whether both could be read, and both say so."""
        below, above = self.entries.get((parent, child)), self.entries.get((child, parent))
        return below is not None and above is not None and below.role is Role.CHILD and above.role is Role.PARENT

    @cached_property
    def agreed(self) -> dict[str, list[str]]:
        """The parents of each robot that agree to be its parents."""
        return {
            robot.name: [parent.name for parent in robot.parents if self.is_parent(parent.name, robot.name)]
            for robot in self.robots
        }

    def has_all_parents(self, name: str) -> bool:
        """Whether every parent of `name` could be read and agrees."""
        return len(self.agreed[name]) == len(self.files[name].robot.parents)

    @cached_property
    def owners(self) -> dict[str, list[str]]:
        """The robots, mostly one, that own each variable."""
        owners: dict[str, list[str]] = {}
        for robot in self.robots:
            for variable in robot.variables:
                owners.setdefault(variable.name, []).append(robot.name)
        return owners

    @cached_property
    def rank(self) -> Mapping[str, int] | None:
        """Each robot's place in the priority order; None while some mistake leaves the order open."""
        if self.broken or not all(self.has_all_parents(name) for name in self.files):
            return None
        try:
            order = priority_order(self.agreed)
        except CycleError:
            return None
        return {name: place for place, name in enumerate(order)}

    @cached_property
    def _used(self) -> dict[str, dict[str, int]]:
        """For each robot the variables in the constraints it holds, and the first line that uses each."""
        used: dict[str, dict[str, int]] = {}
        for robot in self.robots:
            lines = used[robot.name] = {}
            for constraint in robot.shared:
                for variable in constraint.variables:
                    lines.setdefault(variable, constraint.line)
        return used

    def needed(self, parent: str, child: str) -> dict[str, int]:
        """The variables of `parent` in constraints that `child` holds, with the line that needs each."""
        used = self._used[child]
        return {variable: used[variable] for variable in self.files[parent].lines if variable in used}

    def place(self, robot: str, variable: str = "") -> str:
        """File and line of a robot, or of a variable of its, for a message about two robots."""
        file = self.files[robot]
        return f"{file.robot.file}:{file.lines.get(variable, file.line)}"
