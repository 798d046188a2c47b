"""Distances between points, and free points among others."""

from __future__ import annotations

import numpy as np

from robochoc.flight.quadrotor.airframe import Array
from robochoc.flight.quadrotor.rigid_bodies import Mask
from robochoc.maps.routes.wall_plan import WallPlan

_STEPS = 8
"""The number of search steps for free points in each direction; a step is half a distance."""


def nearest_two(points: Array) -> float:
    """Return the distance between the nearest two of `points` (K, 3); infinite for fewer than two points."""
    if len(points) < 2:  # noqa: PLR2004 - a pair
        return float("inf")
    apart = _distances(points, points)
    np.fill_diagonal(apart, np.inf)
    return float(apart.min())


def nearest_distances(points: Array, others: Array) -> Array:
    """Return the distances (K,) from `points` (K, 3) to the nearest of `others` (M, 3); infinite without others."""
    return np.asarray(_distances(points, others).min(axis=1, initial=np.inf))


def free_point(
    wish: Array, taken: Array, radii: Array, ground: float, *, low: bool, floor_plan: WallPlan | None = None
) -> Array:
    """Return the point nearest to `wish`, on a grid around it, that is `radii` (M,) away from `taken` (M, 3).

    The point is on the ground if `low`, else not much lower than `wish`. No wall in the `floor_plan` is between the
    point and `wish`.

    Raises:
        ValueError: Walls leave no such point.
    """
    step = float(radii.max(initial=0.5)) / 2
    steps = np.arange(-_STEPS, _STEPS + 1) * step
    x, y, z = np.meshgrid(steps, steps, [0.0] if low else steps, indexing="ij")
    offsets = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    offsets = offsets[np.argsort(np.square(offsets).sum(1), kind="stable")]
    spots = np.asarray(wish + offsets)
    if low:
        spots[:, 2] = ground
    else:
        spots = spots[spots[:, 2] >= min(ground + 2 * step, wish[2])]
    free: Mask = np.asarray((_distances(spots, taken) >= radii).all(1))
    if floor_plan is not None:
        free[free] = floor_plan.are_clear(np.broadcast_to(wish, spots[free].shape), spots[free])
    if free.any():
        return np.asarray(spots[free.argmax()])
    if floor_plan is not None:
        raise ValueError(f"no free place was found near ({wish[0]:.2f}, {wish[1]:.2f}): walls are too close")
    # No free point on the grid: use a point beyond all others, beside or above.
    beyond = np.array([wish[0], wish[1], ground if low else wish[2]])
    side = 0 if low else 2
    beyond[side] = taken[:, side].max() + 2.001 * step
    return beyond


def _distances(points: Array, others: Array) -> Array:
    return np.asarray(np.sqrt(np.square(points[:, None] - others).sum(2)))
