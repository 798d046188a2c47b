"""Domains of users' values as domains of integers, and back.

Numbers are coded as themselves, times the least number that makes them integers; members of an `IntEnum` and truth
values as their integers. All else becomes symbols: the value 2 stands for the third symbol of the model.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.names import BEYOND
from robochoc.formats.symbols import check_symbol
from robochoc.model.ranges import merge_ranges
from robochoc.modelling.numbers import exact, is_number, is_truth
from robochoc.modelling.places import ModelError, ModelTypeError, Place

MAX_VALUES = 100_000
"""The maximum size of a domain."""


class Kind(NamedTuple):
    """A kind of values. Only values of one kind are compared."""

    name: str
    type: type | None = None

    def __str__(self) -> str:
        return self.name


NUMBER = Kind("a number")
BOOLEAN = Kind("a truth value")


def kind_of(value: object) -> Kind:
    """Return the kind of a value."""
    if is_truth(value):
        return BOOLEAN
    if is_number(value):
        return NUMBER
    if isinstance(value, str) and not isinstance(value, Enum):
        return Kind("a text", str)
    return Kind(f"a {type(value).__name__}", type(value))


@dataclass(frozen=True)
class Codes:
    """A domain, and what its integers stand for.

    Attributes:
        kind: The kind of its values.
        ranges: The integers.
        scale: Of numbers: an integer is so many times the value.
        told: The user's values, by integer, where they are not the integers themselves.
        later: Integers that events add.
    """

    kind: Kind
    ranges: tuple[range, ...]
    scale: int = 1
    told: Mapping[int, Hashable] | None = None
    later: tuple[int, ...] = ()

    def __len__(self) -> int:
        return sum(map(len, self.ranges))

    def __iter__(self) -> Iterator[int]:
        for part in self.ranges:
            yield from part

    @property
    def symbolic(self) -> bool:
        """Whether the integers stand for symbols."""
        return self.kind not in {NUMBER, BOOLEAN}

    def value(self, code: int) -> object:
        """Return the user's value for an integer."""
        return code if self.told is None else self.told.get(code, code)

    @property
    def ever(self) -> tuple[int, ...]:
        """The integers of the domain, and those that events add."""
        return (*self, *(code for code in self.later if not any(code in part for part in self.ranges)))

    @property
    def ends(self) -> tuple[int, int]:
        """The least and the greatest of `ever`."""
        return min([self.ranges[0][0], *self.later]), max([self.ranges[-1][-1], *self.later])

    def code(self, value: object) -> int | None:
        """Return the integer for a user's value, or None where the domain never has such a value."""
        if self.symbolic:
            return self._by_value.get(value)
        if not is_number(value):
            return None
        scaled = exact(value) * self.scale
        known = scaled == int(scaled) and (scaled in self.later or any(int(scaled) in part for part in self.ranges))
        return int(scaled) if known else None

    def with_value(self, value: Hashable, symbols: Symbols) -> tuple[Codes, int]:
        """Return these codes with a value that an event adds, and its integer.

        Raises:
            ModelError: if it is of another kind, or no multiple of the domain's unit.
        """
        if kind_of(value) != self.kind:
            raise ModelTypeError(f"{value!r} is {kind_of(value)}, and the domain has {self.kind}")
        scaled = symbols.code(value) if self.symbolic else exact(exact(value) * self.scale)
        if not isinstance(scaled, int):
            raise ModelError(f"{value!r} is no multiple of 1/{self.scale}, the unit of the domain")
        told = None if self.told is None else {scaled: value, **self.told}
        return replace(self, told=told, later=(*self.later, scaled)), scaled

    @cached_property
    def _by_value(self) -> dict[object, int]:
        return {value: code for code, value in (self.told or {}).items()}


class Symbols:
    """The symbols of a model, which all its symbolic domains share."""

    def __init__(self) -> None:
        self._codes: dict[str, int] = {}
        self._words: dict[tuple[Kind, object], str] = {}

    @property
    def all(self) -> tuple[str, ...]:
        """All symbols, in the order of their integers."""
        return tuple(self._codes)

    def add(self, word: str) -> int:
        """Return the integer for a symbol, which may be a new one."""
        return self._codes.setdefault(word, len(self._codes))

    def code(self, value: Hashable) -> int:
        """Return the integer for a user's value."""
        kind = kind_of(value)
        if (kind, value) not in self._words:
            self._words[kind, value] = self._word(kind, value)
        return self.add(self._words[kind, value])

    def _word(self, kind: Kind, value: object) -> str:
        """Return a symbol for a value: a text or a member's name where it can be one, else something like it."""
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


def codes_of(domain: object, symbols: Symbols, place: Place) -> Codes:
    """Return the codes of a domain: of a range, an `Enum`, `bool`, or values of one kind.

    Raises:
        ModelError: if it is no domain.
    """
    if isinstance(domain, range) and domain.step == 1:
        _check_size(max(0, domain.stop - domain.start), place)  # `len` takes no more than 64 bits
        return _integers([domain], place)
    if domain is bool:
        domain = (False, True)
    if isinstance(domain, str):
        raise ModelTypeError(f"{domain!r} is one text", f"a domain is a list of values: {domain.split()!r}", place)
    if not isinstance(domain, Iterable):
        raise ModelTypeError(f"{domain!r} is no domain", "expected a range, an Enum, or a list of values", place)
    values = list(itertools.islice(domain, MAX_VALUES + 1))
    _check_size(len(values), place)
    for value in values:
        try:
            hash(value)
        except TypeError:
            hint = "use values that cannot, such as tuples"
            raise ModelTypeError(f"the value {value!r} can change", hint, place) from None
    return _listed(values, symbols, place)


def _listed(values: list[Hashable], symbols: Symbols, place: Place) -> Codes:
    kinds = dict.fromkeys(map(kind_of, values))
    if len(kinds) > 1:
        one, other = list(kinds)[:2]
        raise ModelTypeError(f"a domain with {one} and {other}", "the values of a domain are of one kind", place)
    if len(set(values)) < len(values):
        twice = next(value for number, value in enumerate(values) if value in values[:number])
        raise ModelError(f"the value {twice!r} stands twice in the domain", "delete one", place)
    (kind,) = kinds
    if kind == NUMBER:
        return _numbers(values, place)
    if kind == BOOLEAN:
        told: dict[int, Hashable] = {int(bool(value)): bool(value) for value in values}
        return Codes(kind, _ranges(told), told=told)
    told = {symbols.code(value): value for value in values}
    return Codes(kind, _ranges(told), told=told)


def _numbers(values: list[Hashable], place: Place) -> Codes:
    numbers = {value: exact(value) for value in values}
    scale = math.lcm(*(Fraction(number).denominator for number in numbers.values()))
    told = {int(number * scale): value for value, number in numbers.items()}
    if all(type(value) is int for value in values):
        return _integers(_ranges(told), place)
    return replace(_integers(_ranges(told), place), scale=scale, told=told)


def _integers(ranges: Iterable[range], place: Place) -> Codes:
    kept = tuple(ranges)
    if any(not -BEYOND < end < BEYOND for part in kept for end in (part[0], part[-1])):
        raise ModelError("a value of more than 18 digits", "integers have at most 18", place)
    return Codes(NUMBER, kept)


def _ranges(codes: Iterable[int]) -> tuple[range, ...]:
    return merge_ranges(tuple(range(code, code + 1) for code in sorted(codes)))


def _check_size(size: int, place: Place) -> None:
    if not size:
        raise ModelError("a domain without values", "a variable needs one at least", place)
    if size > MAX_VALUES:
        raise ModelError(f"a domain of more than {MAX_VALUES:,} values", "make it smaller", place)
