"""A sketch: a team as somebody has drawn it, before it is a problem.

A sketch says in a few words of everyday language what robots decide, and which rules they follow. It is data, nothing
is computed in it, and nothing in it is changed: an edit (`edits`) returns another sketch. `building` makes a
`robochoc.Model` of it.
"""

from __future__ import annotations

from enum import StrEnum

import msgspec

MAX_ROBOTS = 1_000
"""What a picture can show, and a hand can model. Larger teams are made by `robochoc generate`, or in Python."""
MAX_SIDE = 60
"""Columns, or rows, of a map."""
MAX_VALUES = 4_000
"""Values of one decision."""
MAX_RULES = 2_000
MAX_DECISIONS = 12
MAX_COST = 1_000_000
MAX_LABEL = 60
"""Characters of a name that a user gives."""


Value = int | str
"""A value of a decision."""
Setting = Value | list[Value | list[Value]]
"""What fills an opening of a rule's words: a number or a value, values, or rows of values."""


class Kind(StrEnum):
    """What a decision is about. It tells how its values are written, and how they are shown."""

    LEVEL = "level"
    """A height: numbers."""
    PLACE = "place"
    """A cell of the map: its number, row by row from the south-west."""
    SLOT = "slot"
    """A time, or a berth: numbers."""
    CHANNEL = "channel"
    """A radio channel: numbers."""
    TASK = "task"
    """One of several things to do: names."""
    CHOICE = "choice"
    """Anything else: names."""


NUMBERED = frozenset({Kind.LEVEL, Kind.PLACE, Kind.SLOT, Kind.CHANNEL})
"""Kinds whose values are numbers: they can be compared, and be apart from each other."""


class Cell(msgspec.Struct, forbid_unknown_fields=True, frozen=True, order=True):
    """A cell of the map: column and row, from 0. Row 0 is the southernmost."""

    x: int
    y: int


class Area(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The map: how large it is, and which cells nobody can be at."""

    columns: int = 8
    rows: int = 6
    blocked: frozenset[Cell] = frozenset()

    def number(self, cell: Cell) -> int:
        """Return the number of a cell: a value of a decision of kind `place`."""
        return cell.y * self.columns + cell.x

    def cell(self, number: int) -> Cell:
        """Return the cell of that number."""
        return Cell(number % self.columns, number // self.columns)

    def has(self, cell: Cell) -> bool:
        """Return whether the cell is on the map."""
        return 0 <= cell.x < self.columns and 0 <= cell.y < self.rows

    @property
    def free(self) -> tuple[int, ...]:
        """The numbers of the cells that are not blocked."""
        blocked = {self.number(cell) for cell in self.blocked}
        return tuple(number for number in range(self.columns * self.rows) if number not in blocked)


class SketchRobot(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A robot.

    Attributes:
        name: Its name.
        at: The cell in which it stands.
        weight: How much its stepping aside counts.
        rank: Robots with a higher rank are above others.
    """

    name: str
    at: Cell
    weight: int = 1
    rank: int = 0


class Decision(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What robots decide.

    Attributes:
        name: Its name, such as `slot`: each robot gets a variable of that name.
        kind: What it is about.
        values: Its values: all numbers, or all names, as `kind` has it. Empty for a place: the map's free cells.
        robots: Who decides it. Empty: everybody.
    """

    name: str
    kind: Kind
    values: tuple[int | str, ...] = ()
    robots: tuple[str, ...] = ()


class SketchRule(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A rule of the palette, applied.

    Attributes:
        id: Its name in the team: `R1`, `R2`, ...
        kind: Which rule of the palette (`palette.PALETTE`).
        decision: The decision that it is about.
        robots: Whom it binds. Empty: everybody who takes the decision. For rules with a leader, the first one leads.
        settings: What the rule's words leave open, by name: a number, a value, or several values.
        cost: What it costs to break it. None: it must hold.
        private: Nobody but the robot whose rule it is may learn of it: of two robots, the first one. (What is about one
            robot alone, nobody else learns in any case.)
        on: Whether it counts at present.
    """

    id: str
    kind: str
    decision: str
    robots: tuple[str, ...] = ()
    settings: dict[str, Setting] = {}
    cost: int | None = None
    private: bool = False
    on: bool = True


class Sketch(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A team as it was drawn.

    Attributes:
        name: Its name.
        area: The map.
        robots: The robots, in the order in which they were added.
        decisions: What they decide.
        rules: What they follow.
        story: A sentence about it, for the gallery.
    """

    name: str = "team"
    area: Area = Area()
    robots: tuple[SketchRobot, ...] = ()
    decisions: tuple[Decision, ...] = ()
    rules: tuple[SketchRule, ...] = ()
    story: str = ""

    @property
    def is_ranked(self) -> bool:
        """Whether somebody has said who is above whom."""
        return any(robot.rank for robot in self.robots)

    @property
    def flies(self) -> bool:
        """Whether somebody decides where to be: a level, or a place."""
        return any(decision.kind in {Kind.LEVEL, Kind.PLACE} for decision in self.decisions)

    def robot(self, name: str) -> SketchRobot | None:
        """Return the robot of that name, if there is one."""
        return next((robot for robot in self.robots if robot.name == name), None)

    def decision(self, name: str) -> Decision | None:
        """Return the decision of that name, if there is one."""
        return next((decision for decision in self.decisions if decision.name == name), None)

    def rule(self, name: str) -> SketchRule | None:
        """Return the rule of that name, if there is one."""
        return next((rule for rule in self.rules if rule.id == name), None)

    def deciders(self, decision: Decision) -> tuple[str, ...]:
        """Return who takes a decision, in the order of the robots."""
        chosen = set(decision.robots)
        return tuple(robot.name for robot in self.robots if not chosen or robot.name in chosen)

    def values(self, decision: Decision) -> tuple[int | str, ...]:
        """Return the values of a decision."""
        return self.area.free if decision.kind == Kind.PLACE and not decision.values else decision.values

    def bound(self, rule: SketchRule) -> tuple[str, ...]:
        """Return whom a rule binds: those of its robots that take its decision, in the rule's order."""
        decision = self.decision(rule.decision)
        if decision is None:
            return ()
        deciders = self.deciders(decision)
        known = {*deciders} if rule.robots else set()
        return tuple(name for name in rule.robots if name in known) if rule.robots else deciders
