"""The rules in the palette (`PALETTE`), in the order of the menu."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.app.sketch.palette import (
    ALL_KINDS,
    PLACES,
    Applied,
    Form,
    Links,
    PaletteRule,
    RuleField,
    allowed,
    count,
    equal,
    unequal,
    within,
)
from robochoc.app.sketch.python_text import Operand
from robochoc.app.sketch.sketch import NUMBERED, DecisionKind

_RADIUS = RuleField("radius", Form.NUMBER, 1, 100, 3)
_GAP = RuleField("gap", Form.NUMBER, 1, 100, 2)
_VALUE = RuleField("value", Form.VALUE)
_VALUES = RuleField("values", Form.VALUES)
_COUNT = RuleField("count", Form.NUMBER, 1, 1000, 1)
_STEP = RuleField("step", Form.NUMBER, 1, 1000, 1)
_ROWS = RuleField("rows", Form.TABLE)
_HEIGHTS = frozenset(NUMBERED - PLACES)

Group = Sequence[Operand]


def _squared(given: Applied, pair: Group) -> Operand:
    """Return the squared distance between two cells of the map, or between a cell and a robot's cell."""
    one, other = pair
    columns = given.sketch.area.columns
    across, along = one % columns - other % columns, one // columns - other // columns
    return across * across + along * along


def _apart(given: Applied, pair: Group) -> Operand:
    gap = given.number("gap")
    return _squared(given, pair) >= gap * gap if given.kind == DecisionKind.PLACE else abs(pair[0] - pair[1]) >= gap


def _close(given: Applied, pair: Group) -> Operand:
    gap = given.number("gap")
    return _squared(given, pair) <= gap * gap if given.kind == DecisionKind.PLACE else abs(pair[0] - pair[1]) <= gap


def _different(_: Applied, pair: Group) -> Operand:
    return unequal(pair[0], pair[1])


def _same(_: Applied, pair: Group) -> Operand:
    return equal(pair[0], pair[1])


def _above(_: Applied, pair: Group) -> Operand:
    return pair[0] > pair[1]


def _below(_: Applied, pair: Group) -> Operand:
    return pair[0] < pair[1]


def _north(given: Applied, pair: Group) -> Operand:
    columns = given.sketch.area.columns
    return pair[0] // columns > pair[1] // columns


def _east(given: Applied, pair: Group) -> Operand:
    columns = given.sketch.area.columns
    return pair[0] % columns > pair[1] % columns


def _only(given: Applied, alone: Group) -> Operand:
    return within(alone[0], given.values("values"))


def _never(given: Applied, alone: Group) -> Operand:
    return unequal(alone[0], given.value("value"))


def _prefers(given: Applied, alone: Group) -> Operand:
    return equal(alone[0], given.value("value"))


def _rather(given: Applied, alone: Group) -> Operand:
    wish, step = given.value("value"), given.number("step")
    if given.kind != DecisionKind.PLACE or not isinstance(wish, int):
        return abs(alone[0] - wish) * step
    columns = given.sketch.area.columns  # to compute the number of horizontal and vertical steps on the map
    return (abs(alone[0] % columns - wish % columns) + abs(alone[0] // columns - wish // columns)) * step


def _little(given: Applied, alone: Group) -> Operand:
    return alone[0] * given.number("step")


def _at_most(given: Applied, group: Group) -> Operand:
    return count(group, given.value("value")) <= given.number("count")


def _at_least(given: Applied, group: Group) -> Operand:
    return count(group, given.value("value")) >= given.number("count")


def _table(given: Applied, pair: Group) -> Operand:
    return allowed(pair, given.rows("rows"))


PALETTE: dict[str, PaletteRule] = {
    rule.key: rule
    for rule in (
        PaletteRule("different", ALL_KINDS, Links.PAIRS, _different),
        PaletteRule("apart", NUMBERED, Links.PAIRS, _apart, (_GAP,)),
        PaletteRule("neighbours-different", ALL_KINDS, Links.NEIGHBOURS, _different, (_RADIUS,)),
        PaletteRule("neighbours-apart", NUMBERED, Links.NEIGHBOURS, _apart, (_RADIUS, _GAP)),
        PaletteRule("neighbours-close", NUMBERED, Links.NEIGHBOURS, _close, (_RADIUS, _GAP)),
        PaletteRule("close", NUMBERED, Links.PAIRS, _close, (_GAP,)),
        PaletteRule("same", ALL_KINDS, Links.PAIRS, _same),
        PaletteRule("leader-above", _HEIGHTS, Links.STAR, _above, has_order=True),
        PaletteRule("leader-close", NUMBERED, Links.STAR, _close, (_GAP,), has_order=True),
        PaletteRule("in-order", _HEIGHTS, Links.CHAIN, _below, has_order=True),
        PaletteRule("north-of", PLACES, Links.STAR, _north, has_order=True),
        PaletteRule("east-of", PLACES, Links.STAR, _east, has_order=True),
        PaletteRule("only", ALL_KINDS, Links.EACH, _only, (_VALUES,), fewest=1),
        PaletteRule("never", ALL_KINDS, Links.EACH, _never, (_VALUE,), fewest=1),
        PaletteRule("prefers", ALL_KINDS, Links.EACH, _prefers, (_VALUE,), fewest=1),
        PaletteRule("rather", NUMBERED, Links.EACH, _rather, (_VALUE, _STEP), fewest=1, graded=True),
        PaletteRule("little", _HEIGHTS, Links.EACH, _little, (_STEP,), fewest=1, graded=True),
        PaletteRule("at-most", ALL_KINDS, Links.GROUP, _at_most, (_VALUE, _COUNT)),
        PaletteRule("at-least", ALL_KINDS, Links.GROUP, _at_least, (_VALUE, _COUNT)),
        PaletteRule("table", ALL_KINDS, Links.PAIRS, _table, (_ROWS,), most=2, has_order=True),
    )
}
