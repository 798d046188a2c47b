"""Conversion of domains between users' values and integers.

The code of a number is the number multiplied by the least factor that makes all values integers. The code of a truth
value or of a member of an `IntEnum` is its integer. All other values become symbols: code 2 is the model's third
symbol.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.names import BEYOND
from robochoc.formats.symbols import check_symbol
from robochoc.model.constraint import merge_ranges
from robochoc.model.real import MOST_PLACES, MOST_POINTS, RealInterval, grid
from robochoc.modelling.errors import ModelError, ModelTypeError, SourceLine
from robochoc.modelling.numbers import exact, is_number, is_truth, whole_number
from robochoc.system.lazy_dataclass import dataclass

MAX_VALUES = 100_000
"""The maximum size of a domain."""


class ValueKind(NamedTuple):
    """A kind of values. Only values of the same kind can be compared."""

    name: str
    type: type | None = None

    def __str__(self) -> str:
        return self.name


NUMBER = ValueKind("a number")
BOOLEAN = ValueKind("a truth value")


def kind_of(value: object) -> ValueKind:
    """Return the kind of a value."""
    if is_truth(value):
        return BOOLEAN
    if is_number(value):
        return NUMBER
    if isinstance(value, str) and not isinstance(value, Enum):
        return ValueKind("a text", str)
    return ValueKind(f"a {type(value).__name__}", type(value))


@dataclass(frozen=True)
class DomainCodes:
    """A domain as integers (codes), with the user's value for each code.

    Attributes:
        kind: The kind of the values.
        ranges: The codes.
        scale: For numbers: code = value * scale.
        user_values: The user's values by code. None: the codes are the values.
        later: The codes of the values that events add.
        real: The interval of real numbers. The codes are then numbers of steps of its precision, and `ranges` a grid.
    """

    kind: ValueKind
    ranges: tuple[range, ...]
    scale: int = 1
    user_values: Mapping[int, Hashable] | None = None
    later: tuple[int, ...] = ()
    real: RealInterval | None = None

    def __len__(self) -> int:
        return sum(map(len, self.ranges))

    def __iter__(self) -> Iterator[int]:
        for part in self.ranges:
            yield from part

    @property
    def symbolic(self) -> bool:
        """True if the codes are codes of symbols."""
        return self.kind not in {NUMBER, BOOLEAN}

    def value(self, code: int) -> object:
        """Return the user's value for a code."""
        if self.real:
            return self.real.number(code)
        return code if self.user_values is None else self.user_values.get(code, code)

    @property
    def ever(self) -> tuple[int, ...]:
        """The codes in the domain, and those that events add."""
        return (*self, *(code for code in self.later if not any(code in part for part in self.ranges)))

    @property
    def ends(self) -> tuple[int, int]:
        """The least and the greatest code in `ever`, or of any real number in the interval."""
        if self.real:
            return self.real.low, self.real.high
        return min([self.ranges[0][0], *self.later]), max([self.ranges[-1][-1], *self.later])

    def code(self, value: object) -> int | None:
        """Return the code of a user's value, or None if the domain never contains the value."""
        if self.symbolic:
            return self._by_value.get(value)
        if not is_number(value):
            return None
        if self.real:
            return self.real.steps(exact(value))
        scaled = exact(value) * self.scale
        known = scaled == int(scaled) and (scaled in self.later or any(int(scaled) in part for part in self.ranges))
        return int(scaled) if known else None

    def with_value(self, value: Hashable, symbols: Symbols) -> tuple[DomainCodes, int]:
        """Return the domain extended by a value that an event adds, and the code of that value.

        Raises:
            ModelError: if the value has another kind, or is not a multiple of the domain's unit.
        """
        if kind_of(value) != self.kind:
            raise ModelTypeError(f"{value!r} is {kind_of(value)}, and the domain has {self.kind}")
        scaled = symbols.code(value) if self.symbolic else exact(exact(value) * self.scale)
        if not isinstance(scaled, int):
            raise ModelError(f"{value!r} is not a multiple of 1/{self.scale}, the unit of the domain")
        user_values = None if self.user_values is None else {scaled: value, **self.user_values}
        return replace(self, user_values=user_values, later=(*self.later, scaled)), scaled

    @cached_property
    def _by_value(self) -> dict[object, int]:
        return {value: code for code, value in (self.user_values or {}).items()}


class Symbols:
    """The symbols of a model, shared by all its symbolic domains."""

    def __init__(self) -> None:
        self._codes: dict[str, int] = {}
        self._words: dict[tuple[ValueKind, object], str] = {}

    @property
    def all(self) -> tuple[str, ...]:
        """All symbols, in the order of their codes."""
        return tuple(self._codes)

    def add(self, word: str) -> int:
        """Return the code of a symbol, which is added if it is new."""
        return self._codes.setdefault(word, len(self._codes))

    def code(self, value: Hashable) -> int:
        """Return the code of a user's value, which is added if it is new."""
        kind = kind_of(value)
        if (kind, value) not in self._words:
            self._words[kind, value] = self._word(kind, value)
        return self.add(self._words[kind, value])

    def _word(self, kind: ValueKind, value: object) -> str:
        """Return an unused symbol for a value: its text or member name, adapted if that is not a valid symbol."""
        text = value.name if isinstance(value, Enum) else str(value)
        word = text if _is_symbol(text) else "_".join(re.findall(r"[A-Za-z0-9.]+", text))[:80]
        word = word if _is_symbol(word) else f"v{word}"
        taken = {given for (other, _), given in self._words.items() if other == kind}
        free, number = word, 1
        while free in taken or (number > 1 and free in self._codes):
            number += 1
            free = f"{word}_{number}"
        return free


def _is_symbol(word: str) -> bool:
    try:
        check_symbol(word)
    except MistakeError:
        return False
    return True


def codes_of(domain: object, symbols: Symbols, place: SourceLine) -> DomainCodes:
    """Return the codes of a domain, given as a range, an `Enum`, `bool`, or values of one kind.

    Raises:
        ModelError: if the domain is invalid.
    """
    if isinstance(domain, range) and domain.step == 1:
        _check_size(max(0, domain.stop - domain.start), place)  # `len` fails beyond 64 bits
        return _integers([domain], place)
    if domain is bool:
        domain = (False, True)
    if isinstance(domain, str):
        raise ModelTypeError(
            f"the domain {domain!r} is a single text", f"use a list of values: {domain.split()!r}", place
        )
    if not isinstance(domain, Iterable):
        raise ModelTypeError(f"invalid domain {domain!r}", "expected a range, an Enum, or a list of values", place)
    values = list(itertools.islice(domain, MAX_VALUES + 1))
    _check_size(len(values), place)
    for value in values:
        try:
            hash(value)
        except TypeError:
            hint = "use immutable values, such as tuples"
            raise ModelTypeError(f"the value {value!r} of a domain is not hashable", hint, place) from None
    return _listed(values, symbols, place)


def real_codes(low: object, high: object, precision: object, points: object, place: SourceLine) -> DomainCodes:
    """Return the codes of an interval of real numbers. See `ModelRobot.real`. Raises `ModelError`."""
    step = exact(precision)
    places = next((places for places in range(MOST_PLACES + 1) if step * 10**places == 1), None)
    if places is None:
        hint = f"expected a power of ten of at most {MOST_PLACES} places: 1, 0.1, 0.01, ..."
        raise ModelError(f"invalid precision {precision!r}", hint, place)
    ends = [exact(end) * 10**places for end in (low, high)]
    for end, steps in zip((low, high), ends, strict=True):
        if int(steps) != steps or abs(steps) >= BEYOND:
            hint = f"use a multiple of {precision}, or another precision"
            raise ModelError(f"{end!r} is not a number of at most 18 digits with the precision", hint, place)
    least, most = map(int, ends)
    if least >= most:
        raise ModelError(f"the interval from {low!r} to {high!r} is empty", "write the smaller number first", place)
    number = whole_number(points)
    if number is None or not 1 < number <= MOST_POINTS:
        raise ModelError(f"invalid points={points!r}", f"a grid has 2 to {MOST_POINTS} points", place)
    return DomainCodes(NUMBER, grid(least, most, number), 10**places, real=RealInterval(least, most, places))


def _listed(values: list[Hashable], symbols: Symbols, place: SourceLine) -> DomainCodes:
    kinds = dict.fromkeys(map(kind_of, values))
    if len(kinds) > 1:
        one, other = list(kinds)[:2]
        raise ModelTypeError(f"the domain mixes {one} and {other}", "use values of one kind", place)
    if len(set(values)) < len(values):
        twice = next(value for number, value in enumerate(values) if value in values[:number])
        raise ModelError(f"the value {twice!r} occurs twice in the domain", "remove the duplicate", place)
    (kind,) = kinds
    if kind == NUMBER:
        return _numbers(values, place)
    if kind == BOOLEAN:
        user_values: dict[int, Hashable] = {int(bool(value)): bool(value) for value in values}
        return DomainCodes(kind, _ranges(user_values), user_values=user_values)
    user_values = {symbols.code(value): value for value in values}
    return DomainCodes(kind, _ranges(user_values), user_values=user_values)


def _numbers(values: list[Hashable], place: SourceLine) -> DomainCodes:
    numbers = {value: exact(value) for value in values}
    scale = math.lcm(*(Fraction(number).denominator for number in numbers.values()))
    user_values = {int(number * scale): value for value, number in numbers.items()}
    if all(type(value) is int for value in values):
        return _integers(_ranges(user_values), place)
    return replace(_integers(_ranges(user_values), place), scale=scale, user_values=user_values)


def _integers(ranges: Iterable[range], place: SourceLine) -> DomainCodes:
    kept = tuple(ranges)
    if any(not -BEYOND < end < BEYOND for part in kept for end in (part[0], part[-1])):
        raise ModelError("a value of the domain has more than 18 digits", "use at most 18 digits", place)
    return DomainCodes(NUMBER, kept)


def _ranges(codes: Iterable[int]) -> tuple[range, ...]:
    return merge_ranges(tuple(range(code, code + 1) for code in sorted(codes)))


def _check_size(size: int, place: SourceLine) -> None:
    if not size:
        raise ModelError("the domain is empty", "a variable needs at least one value", place)
    if size > MAX_VALUES:
        raise ModelError(f"the domain has more than {MAX_VALUES:,} values", "make it smaller", place)
