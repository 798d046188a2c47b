"""The palette: all rules that a user can apply without writing a formula.

A rule in the palette defines the kinds of decisions to which it applies, its fields, the robots that it links in the
picture, and its condition. The condition can be applied to terms of a `robochoc.Model`, to Python text (`python_text`)
that the user can copy, and to values, for which it is true or false. The sentence for the rule is in the catalogue
(`app/texts`) under `rule.KEY`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from enum import StrEnum
from typing import cast

from robochoc.app.sketch.python_text import Each, Operand, PythonText
from robochoc.app.sketch.sketch import NUMBERED, DecisionKind, Sketch, SketchRule
from robochoc.modelling import functions
from robochoc.modelling.terms import Term
from robochoc.system.lazy_dataclass import dataclass

ALL_KINDS = frozenset(DecisionKind)
PLACES = frozenset({DecisionKind.PLACE})
NAMED = ALL_KINDS - NUMBERED


class Form(StrEnum):
    """The form of a field in a rule."""

    NUMBER = "number"
    """An integer from `least` to `most`."""
    VALUE = "value"
    """A value of the decision."""
    VALUES = "values"
    """Some values of the decision."""
    TABLE = "table"
    """Pairs of values, chosen by clicks."""


class Links(StrEnum):
    """The robots in each link of a rule. Each link is one constraint, and one line in the picture."""

    EACH = "each"
    """Each robot."""
    PAIRS = "pairs"
    """Each pair of robots."""
    NEIGHBOURS = "neighbours"
    """Each pair of robots within the setting `radius`."""
    STAR = "star"
    """The first robot with each other robot."""
    CHAIN = "chain"
    """Each robot with the next robot in the rule's order."""
    GROUP = "group"
    """All robots together."""


@dataclass(frozen=True)
class RuleField:
    """A field in a rule, which the user fills in. `name` is its key in the rule's settings."""

    name: str
    form: Form
    least: int = 0
    most: int = 1_000
    default: int | None = None


@dataclass(frozen=True)
class Applied:
    """A rule in its sketch."""

    sketch: Sketch
    rule: SketchRule

    def number(self, name: str) -> int:
        """Return a setting that is a number."""
        value = self.rule.settings[name]
        if not isinstance(value, int):
            raise TypeError(f"{name} is {value!r}, not a number")
        return value

    def value(self, name: str) -> int | str:
        """Return a setting that is a value."""
        value = self.rule.settings[name]
        if not isinstance(value, (int, str)):
            raise TypeError(f"{name} is {value!r}, not a value")
        return value

    def values(self, name: str) -> list[int | str]:
        """Return a setting that is a list of values."""
        values = self.rule.settings[name]
        if not isinstance(values, list):
            raise TypeError(f"{name} is {values!r}, not a list")
        return [value for value in values if isinstance(value, (int, str))]

    def rows(self, name: str) -> list[tuple[int | str, int | str]]:
        """Return a setting that is a table of pairs."""
        rows = self.rule.settings[name]
        if not isinstance(rows, list):
            raise TypeError(f"{name} is {rows!r}, not a table")
        return [(row[0], row[1]) for row in rows if isinstance(row, list)]

    @property
    def kind(self) -> DecisionKind:
        """The kind of the rule's decision."""
        decision = self.sketch.decision(self.rule.decision)
        assert decision is not None, "the decision of an applied rule exists"  # noqa: S101
        return decision.kind


@dataclass(frozen=True)
class PaletteRule:
    """A rule in the palette.

    Attributes:
        key: The rule's name.
        kinds: The kinds of decisions to which the rule applies.
        links: The robots in its links.
        openings: Its fields.
        condition: Returns the condition over the decisions of the robots in one link; for a graded rule, the cost.
        fewest: The minimum number of robots.
        most: The maximum number of robots. None: any number.
        graded: True if the rule has graded costs instead of being satisfied or violated.
        has_order: True if the order of the robots matters.
    """

    key: str
    kinds: frozenset[DecisionKind]
    links: Links
    condition: Callable[[Applied, Sequence[Operand]], Operand]
    openings: tuple[RuleField, ...] = ()
    fewest: int = 2
    most: int | None = None
    graded: bool = False
    has_order: bool = False

    def holds(self, given: Applied, values: Sequence[int | str]) -> bool:
        """Return whether robots with these values, in the order of a link, satisfy the rule; always True if graded."""
        return self.graded or bool(self.condition(given, cast("Sequence[Operand]", values)))

    def groups(self, sketch: Sketch, rule: SketchRule) -> Iterator[tuple[str, ...]]:
        """Yield the robots in each link."""
        bound = sketch.bound(rule)
        match self.links:
            case Links.EACH:
                yield from ((name,) for name in bound)
            case Links.PAIRS:
                yield from ((one, other) for index, one in enumerate(bound) for other in bound[index + 1 :])
            case Links.NEIGHBOURS:
                yield from _neighbours(sketch, bound, rule.settings.get("radius", 0))
            case Links.STAR:
                yield from ((bound[0], other) for other in bound[1:])
            case Links.CHAIN:
                yield from itertools.pairwise(bound)
            case Links.GROUP:
                if bound:
                    yield bound


def allowed(pair: Sequence[Operand], rows: list[tuple[int | str, int | str]]) -> Operand:
    """Return the condition that a pair of decisions is one of `rows`."""
    if isinstance(pair[0], PythonText):
        return PythonText.call("robochoc.allowed", [*pair], rows)
    if isinstance(pair[0], Term):
        return functions.allowed([*pair], rows)
    return cast("Operand", cast("object", tuple(pair)) in rows)


def within(one: Operand, values: list[int | str]) -> Operand:
    """Return the condition that a decision is one of `values`."""
    return one.is_in(values) if isinstance(one, (PythonText, Term)) else cast("Operand", cast("object", one) in values)


def count(group: Sequence[Operand], value: int | str) -> Operand:
    """Return the number of decisions whose value is `value`."""
    if isinstance(group[0], Each):
        return PythonText(f"sum({equal(group[0], value)} for a in {group[0].over})")
    if isinstance(group[0], PythonText):
        return PythonText.call("sum", [equal(one, value) for one in group])
    return cast("Operand", sum(cast("list[int]", [equal(one, value) for one in group])))


def equal(one: object, other: object) -> Operand:
    """Return the condition that two decisions are equal."""
    return cast("Operand", one == other)


def unequal(one: object, other: object) -> Operand:
    """Return the condition that two decisions differ."""
    return cast("Operand", one != other)


def _neighbours(sketch: Sketch, bound: Sequence[str], radius: object) -> Iterator[tuple[str, str]]:
    """Yield the pairs of robots within the radius, using a grid of squares of which only adjacent ones are searched."""
    reach = radius if isinstance(radius, int) else 0
    side = max(1, reach)
    standing = {robot.name: robot.at for robot in sketch.robots}
    places = [standing[name] for name in bound]
    squares: dict[tuple[int, int], list[int]] = {}
    for index, here in enumerate(places):
        squares.setdefault((here.x // side, here.y // side), []).append(index)
    for index, here in enumerate(places):
        column, row = here.x // side, here.y // side
        around = itertools.product(range(column - 1, column + 2), range(row - 1, row + 2))
        for other in sorted(one for square in around for one in squares.get(square, ()) if one > index):
            there = places[other]
            if (here.x - there.x) ** 2 + (here.y - there.y) ** 2 <= reach * reach:
                yield bound[index], bound[other]
