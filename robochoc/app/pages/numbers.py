"""Numbers in fields, which are checked since a browser can send any value."""

from __future__ import annotations

from math import isfinite


def bounded_integer(value: object, least: int, most: int, otherwise: int) -> int:
    """Return the integer in a field, within bounds.

    Args:
        value: The value of the field.
        least: The minimum.
        most: The maximum.
        otherwise: The result for a value that is not a number.
    """
    if not isinstance(value, (int, float)) or not isfinite(value):
        return otherwise
    return min(max(int(value), least), most)
