"""Integers, ranges, costs and tuples in texts of XCSP 2.1. The number of digits is checked before conversion."""

from __future__ import annotations

import re
from collections.abc import Iterator
from decimal import Decimal

from robochoc.formats.definitions import MAX_TUPLES, MAX_VALUES
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.xcsp21.instance import Price
from robochoc.model.constraint import INFINITE
from robochoc.model.cost_units import MAX_PLACES

_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_RANGE = re.compile(r"([+-]?[0-9]{1,18})\.\.([+-]?[0-9]{1,18})")
_COST = re.compile(r"[+-]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][+-]?[0-9]{1,2})?")
_INFINITY = re.compile(r"([+-]?)inf(?:inity)?", re.IGNORECASE)
_DIGITS = 18


def is_integer(word: str) -> bool:
    """Return whether `word` is an integer of at most 18 digits."""
    return _INTEGER.fullmatch(word) is not None


def integer(word: str) -> int:
    """Return `word` as an integer. Raises `MistakeError`."""
    if not is_integer(word):
        if _COST.fullmatch(word) or _INFINITY.fullmatch(word):
            raise MistakeError(f"the value {shortened(word)} is not an integer", "scale the values to integers")
        raise MistakeError(f"'{shortened(word)}' is not an integer", "write at most 18 digits, with or without a sign")
    return int(word)


def ranges(text: str) -> tuple[range, ...]:
    """Return the ranges in a domain's text, which may be unordered, in ascending order. Raises `MistakeError`."""
    found = sorted(map(_range, text.split()), key=lambda part: part.start)
    if sum(part.stop - part.start for part in found) > MAX_VALUES:
        raise MistakeError(f"the domain has more than {MAX_VALUES} values", "use a smaller domain")
    apart: list[range] = []
    for part in found:
        if apart and part.start <= apart[-1].stop:
            apart[-1] = range(apart[-1].start, max(apart[-1].stop, part.stop))
        else:
            apart.append(part)
    return tuple(apart)


def _range(word: str) -> range:
    match = _RANGE.fullmatch(word)
    if match is None:
        value = integer(word)
        return range(value, value + 1)
    first, last = int(match[1]), int(match[2])
    if first > last:
        raise MistakeError(f"the range {word} is empty", f"write {last}..{first}")
    return range(first, last + 1)


def finite_cost(word: str, places: int = 0) -> Decimal:
    """Return the cost in `word`, in units of 10 to the power of minus `places`. Raises `MistakeError`."""
    if not _COST.fullmatch(word):
        raise MistakeError(f"'{shortened(word)}' is not a cost", "write a number, 'infinity' or '-infinity'")
    cost = Decimal(word).scaleb(-places).normalize()
    if not cost:
        return Decimal(0)
    digits, exponent = len(cost.as_tuple().digits), int(cost.as_tuple().exponent)
    if -exponent > MAX_PLACES:
        what = f"the cost {shortened(word)} has {-exponent} decimal places"
        raise MistakeError(what, f"write at most {MAX_PLACES} decimal places")
    if digits + exponent > _DIGITS:
        raise MistakeError(f"the cost {shortened(word)} is too large", f"write at most {_DIGITS} digits")
    return cost


class CostReader:
    """Reads costs. A cost that reaches `infinity` or the file's `bound` is infinite.

    A finite cost is a number of units of 10 to the power of minus `places`.
    """

    def __init__(self, *, maximize: bool, infinity: int | None, bound: Decimal | None = None, places: int = 0) -> None:
        self._maximize = maximize
        self._places = places
        stated = [Decimal(one) for one in (infinity, bound) if one is not None]
        self._infinity = min(stated) if stated else None

    def cost(self, word: str) -> Price:
        """Return `word` as a cost. Raises `MistakeError`."""
        infinite = _INFINITY.fullmatch(word)
        if infinite:
            if (infinite[1] == "-") != self._maximize:
                kind, bad = ("utility", "-infinity") if self._maximize else ("cost", "infinity")
                what = f"the {kind} {word} would be better than all others"
                raise MistakeError(what, f"write a number, or '{bad}' for a forbidden tuple")
            return INFINITE
        cost = finite_cost(word)
        if self._infinity is not None and (-cost if self._maximize else cost) >= self._infinity:
            return INFINITE
        return finite_cost(word, self._places)


def unit_places(word: str) -> int:
    """Return the decimal places of a unit of costs: 2 of 0.01. Raises `MistakeError`."""
    match = re.fullmatch(r"0\.(0*1)", word)
    if match is None or len(match[1]) > MAX_PLACES:
        raise MistakeError(f"the unit of costs '{shortened(word)}' is not valid", "write 0.1, 0.01 or a smaller unit")
    return len(match[1])


def split_tuples(text: str) -> Iterator[tuple[str, str]]:
    """Yield, for each tuple in the text of a relation, the text of its cost (may be empty) and of its values."""
    parts = text.split("|")
    if len(parts) > MAX_TUPLES + 1:
        raise MistakeError(f"the relation has more than {MAX_TUPLES} tuples", "use smaller domains or scopes")
    for part in parts:
        cost, _, values = part.rpartition(":")
        if part.strip():
            yield cost.strip(), values
