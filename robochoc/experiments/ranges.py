"""Ranges of numbers in a study's file: `"1..30"`, `"0.1..0.9:0.2"`."""

from __future__ import annotations

import re
from decimal import Decimal

MAX_VALUES = 100_000
"""A range has no more values."""
_NUMBER = r"-?\d+(?:\.\d+)?"
_RANGE = re.compile(rf"({_NUMBER})\.\.({_NUMBER})(?::({_NUMBER}))?", re.ASCII)
_MAX_LENGTH = 100


def range_of(text: str) -> list[int] | list[float] | None:
    """Return the numbers of a range, both ends included; None if `text` is none.

    Args:
        text: `FIRST..LAST`, or `FIRST..LAST:STEP`. Without a step it is 1. Numbers are whole if all that is written is.

    Raises:
        ValueError: if it has no value, or too many.
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
