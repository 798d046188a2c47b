"""A sketch: a team drawn by the user, with the robots' decisions and rules.

A sketch is immutable: an edit (`edits`) returns a new sketch. `building` converts a sketch to a `robochoc.Model`.
"""

from __future__ import annotations

from enum import StrEnum

import msgspec

MAX_ROBOTS = 1_000
"""The most robots that can be drawn and modelled by hand. Larger teams: `robochoc generate`, or Python."""
MAX_SIDE = 60
"""The maximum number of columns or rows of a map."""
MAX_VALUES = 4_000
"""The maximum number of values of one decision."""
MAX_RULES = 2_000
MAX_DECISIONS = 12
MAX_COST = 1_000_000
MAX_LABEL = 60
"""The maximum number of characters of a name."""


Value = int | str
"""A value of a decision."""
Setting = Value | list[Value | list[Value]]
"""The value of a field in a rule: a number or a value, several values, or rows of values."""


class DecisionKind(StrEnum):
    """The kind of a decision, which determines the form of its values and how they are shown."""

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


NUMBERED = frozenset({DecisionKind.LEVEL, DecisionKind.PLACE, DecisionKind.SLOT, DecisionKind.CHANNEL})
"""The kinds of decisions whose values are numbers, which can be compared and subtracted."""


class Cell(msgspec.Struct, forbid_unknown_fields=True, frozen=True, order=True):
    """A cell of the map: its column and row, from 0. Row 0 is the southernmost row."""

    x: int
    y: int


class Area(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The map: its size and its blocked cells."""

    columns: int = 8
    rows: int = 6
    blocked: frozenset[Cell] = frozenset()

    def number(self, cell: Cell) -> int:
        """Return the number of a cell, as used in decisions of kind `place`."""
        return cell.y * self.columns + cell.x

    def cell(self, number: int) -> Cell:
        """Return the cell with this number."""
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
        name: The robot's name.
        at: The robot's cell.
        weight: The weight of the robot's withdrawal.
        rank: The robot's rank; robots with a higher rank have a higher priority.
    """

    name: str
    at: Cell
    weight: int = 1
    rank: int = 0


class Decision(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A decision of robots.

    Attributes:
        name: The name, such as `slot`: each robot has a variable with this name.
        kind: The kind of decision.
        values: The values: all numbers or all names, depending on `kind`. Empty, for a place: the map's free cells.
        robots: The robots with this decision. Empty: all robots.
    """

    name: str
    kind: DecisionKind
    values: tuple[int | str, ...] = ()
    robots: tuple[str, ...] = ()


class SketchRule(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A rule from the palette, used in a sketch.

    Attributes:
        id: The rule's name in the team: `R1`, `R2`, ...
        kind: The key of the rule in the palette (`rules.PALETTE`).
        decision: The decision that it restricts.
        robots: The robots in the rule. Empty: all robots with the decision. In rules with a leader, it is the first
            robot.
        settings: The values of the rule's fields, by name: numbers, values, or lists of values.
        cost: The cost of a violation. None: a hard rule.
        private: True if only the rule's owner knows it, which is the first of the two robots. (Rules for a single
            robot are never disclosed.)
        on: True if the rule is active.
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
    """A team drawn by the user.

    Attributes:
        name: The team's name.
        area: The map.
        robots: The robots, in the order of their creation.
        decisions: The robots' decisions.
        rules: The robots' rules.
        story: A description for the gallery.
    """

    name: str = "team"
    area: Area = Area()
    robots: tuple[SketchRobot, ...] = ()
    decisions: tuple[Decision, ...] = ()
    rules: tuple[SketchRule, ...] = ()
    story: str = ""

    @property
    def is_ranked(self) -> bool:
        """True if robots have ranks."""
        return any(robot.rank for robot in self.robots)

    @property
    def flies(self) -> bool:
        """True if some decisions are positions of robots: levels or places."""
        return any(decision.kind in {DecisionKind.LEVEL, DecisionKind.PLACE} for decision in self.decisions)

    def robot(self, name: str) -> SketchRobot | None:
        """Return the robot with this name, if there is one."""
        return next((robot for robot in self.robots if robot.name == name), None)

    def decision(self, name: str) -> Decision | None:
        """Return the decision with this name, if there is one."""
        return next((decision for decision in self.decisions if decision.name == name), None)

    def rule(self, name: str) -> SketchRule | None:
        """Return the rule with this name, if there is one."""
        return next((rule for rule in self.rules if rule.id == name), None)

    def deciders(self, decision: Decision) -> tuple[str, ...]:
        """Return the robots that have a decision, in the order of the robots."""
        chosen = set(decision.robots)
        return tuple(robot.name for robot in self.robots if not chosen or robot.name in chosen)

    def values(self, decision: Decision) -> tuple[int | str, ...]:
        """Return the values of a decision."""
        return self.area.free if decision.kind == DecisionKind.PLACE and not decision.values else decision.values

    def bound(self, rule: SketchRule) -> tuple[str, ...]:
        """Return the robots in a rule that have its decision, in the order of the rule."""
        decision = self.decision(rule.decision)
        if decision is None:
            return ()
        deciders = self.deciders(decision)
        known = {*deciders} if rule.robots else set()
        return tuple(name for name in rule.robots if name in known) if rule.robots else deciders
