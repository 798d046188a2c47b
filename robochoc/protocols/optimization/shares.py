"""Shares of a threshold: how ADOPT splits it among the children, for each own value, t(d, l)."""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.protocols.optimization.bounding import Bounds
from robochoc.protocols.optimization.bounding_messages import Number


def clamp_share(t: list[Number], bounds: Bounds, index: int) -> None:
    """Keep a child's share within its bounds, for the value at `index`: lb(d, l) <= t(d, l) <= ub(d, l)."""
    t[index] = min(max(t[index], bounds.lb[index]), bounds.ub[index])


def split_threshold(
    threshold: Number, shares: Mapping[str, list[Number]], bounds: Mapping[str, Bounds], index: int
) -> None:
    """Change the children's shares for the value at `index` until they add up to `threshold`, which is finite."""
    spare = threshold - sum(t[index] for t in shares.values())
    for child, t in shares.items():
        limits = bounds[child]
        step = min(spare, limits.ub[index] - t[index]) if spare > 0 else max(spare, limits.lb[index] - t[index])
        t[index] += step
        spare -= step
