"""The locations of a robot's parts, for messages: lines in its file, or names of its objects."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Protocol

from robochoc.formats.diagnostics import Diagnostic, shortened
from robochoc.formats.names import in_short
from robochoc.model.problem import Child, Constraint, Parent
from robochoc.system.lazy_dataclass import dataclass


class Location(NamedTuple):
    """A line in a file (0: the whole file), or an object given by its kind and name."""

    file: str
    line: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file

    def mistake(self, message: str, hint: str) -> Diagnostic:
        """Return a diagnostic for this location."""
        return Diagnostic(self.file, self.line, message, hint)


class Locations(Protocol):
    """The locations of one robot and its parts."""

    def robot(self) -> Location:
        """Return the location of the robot."""

    def variable(self, name: str) -> Location:
        """Return the location of the variable `name`."""

    def constraint(self, constraint: Constraint) -> Location:
        """Return the location of a constraint of the robot."""

    def neighbour(self, neighbour: Parent | Child) -> Location:
        """Return the location of a neighbour's entry."""

    def absent(self, name: str) -> tuple[str, str]:
        """Return the message and the hint for a neighbour that is missing in the team."""


@dataclass(frozen=True)
class FileLocations:
    """The locations of a robot in the XML file `file`: its presentation is in `line`, its variables are in `lines`."""

    file: str
    line: int
    lines: Mapping[str, int]

    def robot(self) -> Location:
        """Return the line of the presentation."""
        return Location(self.file, self.line)

    def variable(self, name: str) -> Location:
        """Return the line of a variable."""
        return Location(self.file, self.lines.get(name, self.line))

    def constraint(self, constraint: Constraint) -> Location:
        """Return the line of a constraint."""
        return Location(self.file, constraint.line)

    def neighbour(self, neighbour: Parent | Child) -> Location:
        """Return the line of a neighbour's entry."""
        return Location(self.file, neighbour.line)

    def absent(self, name: str) -> tuple[str, str]:
        """Return the message that the neighbour's file is missing, and the hint."""
        missing = Path(self.file).parent / name
        return f"has no file: there is no {missing}.xml", "write that file or delete this agent"


@dataclass(frozen=True)
class ObjectLocations:
    """The locations of a robot built in Python, given by names. Line numbers are ignored."""

    name: str

    def robot(self) -> Location:
        """Return the robot."""
        return Location(f"robot {shortened(self.name)}")

    def variable(self, name: str) -> Location:
        """Return a variable, by its name."""
        return self._part("variable", name)

    def constraint(self, constraint: Constraint) -> Location:
        """Return a constraint by its name, which need not be unique, and its scope."""
        scope = shortened(" ".join(map(in_short, constraint.scope)))
        return Location(f"{self.robot()}, constraint {shortened(constraint.name)} ({scope})")

    def neighbour(self, neighbour: Parent | Child) -> Location:
        """Return a neighbour, by its name."""
        return self._part("parent" if isinstance(neighbour, Parent) else "child", neighbour.name)

    def part(self, what: str, name: str) -> Location:
        """Return another part of the robot, by its name."""
        return self._part(what, name)

    def absent(self, name: str) -> tuple[str, str]:
        """Return the message that the robot is missing in the team, and the hint."""
        return f"is not in the team: there is no robot '{name}'", "add that robot or leave this neighbour out"

    def _part(self, what: str, name: str) -> Location:
        return Location(f"{self.robot()}, {what} {shortened(name)}")
