"""The locations of a robot's parts, for messages: lines of its file, or names of its objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

from robochoc.formats.diagnostics import Diagnostic, shortened
from robochoc.formats.names import in_short
from robochoc.model.problem import Child, Constraint, Parent


class Location(NamedTuple):
    """A file and a line in it (0: no line is to blame); or an object, by what it is and is called."""

    file: str
    line: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file

    def mistake(self, message: str, hint: str) -> Diagnostic:
        """Return what is wrong there."""
        return Diagnostic(self.file, self.line, message, hint)


class Locations(Protocol):
    """The locations of one robot and its parts."""

    def robot(self) -> Location:
        """Return where the robot itself stands."""

    def variable(self, name: str) -> Location:
        """Return where its variable `name` stands."""

    def constraint(self, constraint: Constraint) -> Location:
        """Return where a constraint that it holds stands."""

    def neighbour(self, neighbour: Parent | Child) -> Location:
        """Return where a neighbour is listed."""

    def absent(self, name: str) -> tuple[str, str]:
        """Return the message and the hint for a neighbour that is not there."""


@dataclass(frozen=True)
class FileLocations:
    """A robot in the XML file `file`, which says in `line` what kind of problem it is, and its variables in `lines`."""

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
        """Return the line that the constraint was read from."""
        return Location(self.file, constraint.line)

    def neighbour(self, neighbour: Parent | Child) -> Location:
        """Return the line that the neighbour was read from."""
        return Location(self.file, neighbour.line)

    def absent(self, name: str) -> tuple[str, str]:
        """Return the file that should be there."""
        missing = Path(self.file).parent / name
        return f"has no file: there is no {missing}.xml", "write that file or delete this agent"


@dataclass(frozen=True)
class ObjectLocations:
    """A robot that was built in Python. Lines of a file that it may once have been read from are ignored."""

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
        """Return anything else of the robot, by its name."""
        return self._part(what, name)

    def absent(self, name: str) -> tuple[str, str]:
        """Return that there is no such robot."""
        return f"is not in the team: there is no robot '{name}'", "add that robot or leave this neighbour out"

    def _part(self, what: str, name: str) -> Location:
        return Location(f"{self.robot()}, {what} {shortened(name)}")
