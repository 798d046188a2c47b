"""Distances between points, straight lines and moving points.

Lengths are in metres, arrays contain float64, and a point is a row with three elements.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SLACK_M = 1e-10
"""The tolerance for rounding: points are too near only if they are nearer than the distance by more than this."""


def squashed(points: Array, downwash: float) -> Array:
    """Return `points` (..., 3) with heights divided by `downwash`, which maps tall ellipsoids to spheres."""
    return np.asarray(points / np.array([1.0, 1.0, downwash]))


def segment_distances(origins: Array, ends: Array, points: Array) -> Array:
    """Return the distances (K, P) between the straight lines from `origins` to `ends` (K, 3) and `points` (P, 3)."""
    along = ends - origins
    squared = np.einsum("kc,kc->k", along, along)
    squared[squared == 0] = 1
    apart = points[None] - origins[:, None]
    share = np.einsum("kpc,kc->kp", apart, along) / squared[:, None]
    np.clip(share, 0, 1, out=share)
    apart -= share[..., None] * along[:, None]
    return norms(apart)


def line_distances(first: tuple[Array, Array], second: tuple[Array, Array]) -> Array:
    """Return the distances between straight lines, given by origins and ends (..., 3), which are broadcast.

    Source: C. Ericson, "Real-Time Collision Detection", 2005, section 5.1.9.
    """
    along, other = first[1] - first[0], second[1] - second[0]
    apart = first[0] - second[0]
    a, e = _dot(along, along), _dot(other, other)
    b, c, f = _dot(along, other), _dot(along, apart), _dot(other, apart)
    parallel, is_point = a * e - b * b, e == 0
    a, e = np.where(a == 0, 1, a), np.where(e == 0, 1, e)
    share = np.where(parallel > 0, np.clip((b * f - c * e) / np.where(parallel > 0, parallel, 1), 0, 1), 0)
    across = (b * share + f) / e
    share = np.where(across > 1, np.clip((b - c) / a, 0, 1), share)
    share = np.where((across < 0) | is_point, np.clip(-c / a, 0, 1), share)
    across = np.clip(across, 0, 1)
    return norms(apart + share[..., None] * along - across[..., None] * other)


def _dot(first: Array, second: Array) -> Array:
    product: Array = np.einsum("...c,...c->...", *np.broadcast_arrays(first, second))
    return product


def norms(vectors: Array) -> Array:
    """Return the lengths of vectors along the last axis."""
    lengths: Array = np.sqrt(np.einsum("...c,...c->...", vectors, vectors))
    return lengths


def closest_approach(apart: Array, later: Array) -> Array:
    """Return the smallest distance of two points in uniform motion, from their differences at the start and the end.

    Vectors are along the last axis.
    """
    change = later - apart
    squared = np.einsum("...c,...c->...", change, change)
    squared[squared == 0] = 1
    share = -np.einsum("...c,...c->...", apart, change) / squared
    np.clip(share, 0, 1, out=share)
    return norms(apart + share[..., None] * change)
