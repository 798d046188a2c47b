"""The limit up to which floats represent costs exactly. A separate module without numpy, for a fast import."""

from __future__ import annotations

from robochoc.solver.errors import TooLargeError

EXACT = 1 << 53
"""Floats represent all integers below this limit exactly."""


def check_exact(most: float) -> None:
    """Raise `TooLargeError` if `most`, the maximum sum of costs, is too large for exact floats."""
    if most >= EXACT:
        raise TooLargeError("costs may add up to 2^53 or more, too much for exact tables: use smaller costs")
