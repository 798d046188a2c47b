"""A table of a study's file: where its keys stand, and what their lists and ranges come to."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from robochoc.experiments.ranges import range_of
from robochoc.formats.diagnostics import InvalidInputError, invalid_input, shortened, suggestion
from robochoc.formats.toml import line_of

HINT = "docs/guides/experiments.md describes the file of a study"
MAX_INTEGER = 2**53
"""JSON and SQLite hold all integers up to it, and floats have them exactly."""
MOST_COMBINATIONS = 100_000
"""A table stands for no more."""


@dataclass(frozen=True)
class Place:
    """A table of a study's file.

    Attributes:
        path: The file.
        text: Its content.
        table: The table's name. Empty: keys before all tables.
        number: Which of several tables of that name, from 0.
    """

    path: Path
    text: str
    table: str = ""
    number: int = 0

    def below(self, table: str, number: int = 0) -> Place:
        """Return the place of a table."""
        return replace(self, table=table, number=number)

    def line(self, key: str) -> int:
        """Return the line of a key, or of its table if the key is empty or stands elsewhere; 0 if there is none."""
        return line_of(self.text, self.table, key, self.number)

    def mistake(self, key: str, message: str, hint: str = HINT) -> InvalidInputError:
        """Return the error that something is wrong with a key; empty: with the table."""
        named = ".".join(filter(None, (self.table, key)))
        told = f"{shortened(named)}: {message}" if named else message
        return invalid_input(self.path, told, hint, self.line(key))

    def check_keys(self, table: Mapping[str, Any], known: Collection[str]) -> None:
        """Raise `InvalidInputError` for a key that is not known."""
        for key in table:
            if key not in known:
                raise self.mistake(key, "there is no such key", suggestion(key, known, "keys"))

    def values(self, key: str, given: object) -> list[Any]:
        """Return the values that a list, a range or a plain value stands for.

        Raises:
            InvalidInputError: if there are none, or they are no plain values.
        """
        found: list[Any] = []
        for one in given if isinstance(given, list) else [given]:
            try:
                numbers = range_of(one) if isinstance(one, str) else None
            except ValueError as wrong:
                raise self.mistake(key, str(wrong)) from None
            if not all(map(_is_plain, [one] if numbers is None else numbers)):
                told = f"expected numbers, words, or a list of them (integers up to 2^53), got {shortened(str(one))}"
                raise self.mistake(key, told)
            found += [one] if numbers is None else numbers
        if not found:
            raise self.mistake(key, "expected at least one value")
        return list(dict.fromkeys(found))

    def combinations(self, table: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """Yield all combinations of the values in `table`; the last key varies fastest.

        Raises:
            InvalidInputError: if there are too many, or values are none.
        """
        keys = list(table)
        several = [self.values(key, table[key]) for key in keys]
        if (count := math.prod(map(len, several))) > MOST_COMBINATIONS:
            told = f"stands for {count:,} combinations; at most {MOST_COMBINATIONS:,} are allowed"
            raise self.mistake("", told, "cut its lists and ranges")
        for values in itertools.product(*several):
            yield dict(zip(keys, values, strict=True))


def _is_plain(value: object) -> bool:
    """Return whether a value is a word or a number of which JSON and SQLite can hold all digits."""
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, str) or (isinstance(value, int) and abs(value) <= MAX_INTEGER)
