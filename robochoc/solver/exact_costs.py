"""Costs that floats hold exactly. Without numpy: a check need not import what computes with tables."""

from __future__ import annotations

from robochoc.solver.encoding import TooLargeError

EXACT = 1 << 53
"""Below it, floats hold all integers."""


def check_exact(most: float) -> None:
    """Raise `TooLargeError` where costs could add up to `most`, and floats do not hold all integers up to there."""
    if most >= EXACT:
        raise TooLargeError("costs could add up to 2^53 or more, which tables do not hold exactly")
