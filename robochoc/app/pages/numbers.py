"""Numbers of fields. A browser sends what it likes: also no number, or one that is no integer."""

from __future__ import annotations

from math import isfinite


def whole(value: object, least: int, most: int, otherwise: int) -> int:
    """Return the integer in a field, within bounds.

    Args:
        value: What is in the field.
        least: The least that it can be.
        most: The most.
        otherwise: What it is taken for if it is no number.
    """
    if not isinstance(value, (int, float)) or not isfinite(value):
        return otherwise
    return min(max(int(value), least), most)
