"""The tables in a study's file: the lines of keys, and the values in lists and ranges."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

from robochoc.formats.diagnostics import InvalidInputError, invalid_input, shortened, suggestion
from robochoc.formats.toml import line_of
from robochoc.system.lazy_dataclass import dataclass

HINT = "the page Experiments of the documentation describes the file of a study"
MAX_INTEGER = 2**53
"""The largest integer that JSON, SQLite and floats represent exactly."""
MOST_COMBINATIONS = 100_000
"""The maximum number of combinations in a table."""
MAX_VALUES = 100_000
"""The maximum number of values in a range."""
_NUMBER = r"-?\d+(?:\.\d+)?"
_RANGE = re.compile(rf"({_NUMBER})\.\.({_NUMBER})(?::({_NUMBER}))?", re.ASCII)
_MAX_LENGTH = 100


@dataclass(frozen=True)
class Place:
    """A table in a study's file.

    Attributes:
        path: The study's file.
        text: The content of the file.
        table: The table's name. Empty: the keys before all tables.
        number: The index of the table among the tables with the same name, from 0.
    """

    path: Path
    text: str
    table: str = ""
    number: int = 0

    def below(self, table: str, number: int = 0) -> Place:
        """Return the place of a table in the same file."""
        return replace(self, table=table, number=number)

    def line(self, key: str) -> int:
        """Return the line of a key, or of the table if the key is empty or missing, or 0 if neither exists."""
        return line_of(self.text, self.table, key, self.number)

    def mistake(self, key: str, message: str, hint: str = HINT) -> InvalidInputError:
        """Return the error for an invalid key, or for the table if the key is empty."""
        named = ".".join(filter(None, (self.table, key)))
        text = f"{shortened(named)}: {message}" if named else message
        return invalid_input(self.path, text, hint, self.line(key))

    def check_keys(self, table: Mapping[str, Any], known: Collection[str]) -> None:
        """Raise `InvalidInputError` for an unknown key."""
        for key in table:
            if key not in known:
                raise self.mistake(key, "there is no such key", suggestion(key, known, "keys"))

    def values(self, key: str, given: object) -> list[Any]:
        """Return the values in a list or range, or a plain value as the only one.

        Raises:
            InvalidInputError: if there are no values, or they are not plain values.
        """
        found: list[Any] = []
        for one in given if isinstance(given, list) else [given]:
            try:
                numbers = range_of(one) if isinstance(one, str) else None
            except ValueError as wrong:
                raise self.mistake(key, str(wrong)) from None
            if not all(map(_is_plain, [one] if numbers is None else numbers)):
                text = f"expected numbers, words, or a list of them (integers up to 2^53), got {shortened(str(one))}"
                raise self.mistake(key, text)
            found += [one] if numbers is None else numbers
        if not found:
            raise self.mistake(key, "expected at least one value")
        return list(dict.fromkeys(found))

    def combinations(self, table: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """Yield all combinations of the values in `table`; the last key varies fastest.

        Raises:
            InvalidInputError: if there are too many combinations, or a value is invalid.
        """
        keys = list(table)
        several = [self.values(key, table[key]) for key in keys]
        if (count := math.prod(map(len, several))) > MOST_COMBINATIONS:
            text = f"describes {count:,} combinations; at most {MOST_COMBINATIONS:,} are allowed"
            raise self.mistake("", text, "shorten its lists and ranges")
        for values in itertools.product(*several):
            yield dict(zip(keys, values, strict=True))


def _is_plain(value: object) -> bool:
    """Return whether a value is a word, or a number that JSON and SQLite store exactly."""
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, str) or (isinstance(value, int) and abs(value) <= MAX_INTEGER)


def range_of(text: str) -> list[int] | list[float] | None:
    """Return the numbers in a range, including both ends, or None if `text` is not a range.

    Args:
        text: `FIRST..LAST`, or `FIRST..LAST:STEP` (default step: 1). The result has integers if all three are integers.

    Raises:
        ValueError: if the range has no values, or too many.
    """
    found = _RANGE.fullmatch(text) if len(text) <= _MAX_LENGTH else None
    if found is None:
        return None
    first, last, step = (Decimal(one or 1) for one in found.groups())
    if step <= 0 or last < first:
        raise ValueError(f"the range {text!r} has no value; expected FIRST..LAST or FIRST..LAST:STEP")
    count = int((last - first) / step) + 1
    if count > MAX_VALUES:
        raise ValueError(f"the range {text!r} has {count:,} values; at most {MAX_VALUES:,} are allowed")
    numbers = [first + place * step for place in range(count)]
    return [float(one) for one in numbers] if "." in text.replace("..", "") else [int(one) for one in numbers]
