"""The surface of a three-dimensional map: distances of points and straight lines from voxels that are not free.

All lengths are in voxels, and places are relative to the map's lowest corner. Only solid voxels next to a free voxel
are relevant. These are grouped into blocks, so that few voxels have to be compared.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import product

import numpy as np
import numpy.typing as npt

from robochoc.maps.routes.distances import Array, Flags, norms, segment_distances

_BLOCK = 4
"""The side length of a block, in voxels."""
_HALF_DIAGONAL = math.sqrt(3) / 2
_ROUNDING = 1e-9
_PORTION = 500_000

Numbers = npt.NDArray[np.int64]


class VoxelSurface:
    """Measures distances from the `solid` voxels, given by z, y and x. The outside of the map is also solid."""

    def __init__(self, solid: Flags) -> None:
        self._solid = solid
        z, y, x = solid.shape
        self._size = np.array([x, y, z])
        self._blocks = -(-self._size // _BLOCK)

    def distances(self, places: Array, most: float) -> Array:
        """Return the distances (K,) of `places` (K, 3) from the nearest solid voxels, at most `most`."""
        outside = np.minimum(places, self._size - places).min(axis=1)
        found: Array = np.clip(outside, 0, most)
        voxels = np.floor(places).astype(np.int64).clip(0, self._size - 1)
        found[self._solid[voxels[:, 2], voxels[:, 1], voxels[:, 0]]] = 0
        asked = np.flatnonzero(found > 0)
        if not len(asked):
            return found
        blocks, which = np.unique(voxels[asked] // _BLOCK, axis=0, return_inverse=True)
        order = np.argsort(which.ravel(), kind="stable")
        groups = np.split(asked[order], np.cumsum(np.bincount(which.ravel()))[:-1])
        for block, group in zip(blocks, groups, strict=True):
            near = self._near(block[None], most)
            if len(near):
                for some in np.array_split(group, 1 + len(group) * len(near) // _PORTION):
                    apart = norms(_gaps(places[some, None], near[None])).min(axis=1)
                    found[some] = np.minimum(found[some], apart)
        return found

    def clear(self, first: Array, second: Array, radius: float) -> bool:
        """Return whether a straight line is at least `radius` from all solid voxels."""
        low, high = np.minimum(first, second) - radius, np.maximum(first, second) + radius
        if (low < -_ROUNDING).any() or (high > self._size + _ROUNDING).any():
            return False
        x, y, z = np.floor(first).astype(np.int64).clip(0, self._size - 1)
        if self._solid[z, y, x] and radius > 0:
            return False
        length = float(norms(second - first))
        count = 1 + math.ceil(2 * length / _BLOCK)
        shares = np.linspace(0, 1, count)[:, None]
        blocks = np.unique(((first + shares * (second - first)) // _BLOCK).astype(np.int64), axis=0)
        near = self._near(blocks, radius + _BLOCK / 4)
        if not len(near):
            return True
        apart = segment_distances(first[None], second[None], near.astype(np.float64) + 0.5)[0]
        if (apart < radius).any():
            return False
        near = near[apart < radius + _HALF_DIAGONAL]
        return not len(near) or float(_line_distances(first, second, near).min()) >= radius - _ROUNDING

    def _near(self, blocks: Numbers, reach: float) -> Numbers:
        """Return all voxels (K, 3) on the surface that may be within `reach` of one of `blocks` (B, 3)."""
        steps = range(-(far := math.ceil((reach + 1) / _BLOCK)), far + 1)
        moves = np.array([*product(steps, repeat=3)])
        around = (blocks[:, None] + moves[None]).reshape(-1, 3)
        around = around[((around >= 0) & (around < self._blocks)).all(axis=1)]
        numbers = np.unique(self._number(around))
        begins, ends = self._begins[numbers], self._begins[numbers + 1]
        counts = ends - begins
        offsets = np.repeat(begins - np.cumsum(counts) + counts, counts)
        found: Numbers = self._voxels[offsets + np.arange(counts.sum())]
        return found

    def _number(self, blocks: Numbers) -> Numbers:
        """Return the numbers of blocks (..., 3)."""
        x, y, z = np.moveaxis(blocks, -1, 0)
        numbers: Numbers = (z * self._blocks[1] + y) * self._blocks[0] + x
        return numbers

    @cached_property
    def _sorted(self) -> tuple[Numbers, Numbers]:
        """The voxels on the surface (K, 3), block by block, and the index of each block's first voxel."""
        free = np.pad(~self._solid, 1)
        for axis in range(3):
            lines = np.moveaxis(free, axis, 0)
            lines[1:-1] |= lines[:-2] | lines[2:]
        surface = self._solid & free[1:-1, 1:-1, 1:-1]
        voxels = np.argwhere(surface)[:, ::-1].astype(np.int64)
        numbers = self._number(voxels // _BLOCK)
        order = np.argsort(numbers, kind="stable")
        counts = np.bincount(numbers, minlength=int(self._blocks.prod()))
        return voxels[order], np.concatenate(([0], np.cumsum(counts)))

    @property
    def _voxels(self) -> Numbers:
        return self._sorted[0]

    @property
    def _begins(self) -> Numbers:
        return self._sorted[1]


def _gaps(places: Array, voxels: Numbers) -> Array:
    """Return the distance of places from voxels along each axis."""
    gaps: Array = np.maximum(np.maximum(voxels - places, places - voxels - 1), 0)
    return gaps


def _line_distances(first: Array, second: Array, voxels: Numbers) -> Array:
    """Return the distance (K,) of a straight line from each of `voxels` (K, 3).

    The squared distance is a convex, piecewise quadratic function of the position on the line. So its slope is
    piecewise linear, and changes where the line enters or leaves the space between two opposite sides of a voxel.
    """
    along = second - first
    moves = along != 0
    ends = np.concatenate(((voxels - first)[:, moves], (voxels + 1 - first)[:, moves]), axis=1)
    ends = np.clip(ends / np.tile(along[moves], 2), 0, 1)
    ends = np.sort(np.concatenate((np.zeros((len(voxels), 1)), ends, np.ones((len(voxels), 1))), axis=1), axis=1)
    offs = first + ends[..., None] * along - voxels[:, None]
    slopes = (np.minimum(offs, 0) + np.maximum(offs - 1, 0)) @ along
    falls = np.maximum((slopes < 0).sum(axis=1) - 1, 0)
    rows = np.arange(len(voxels))
    rises = np.minimum(falls + 1, ends.shape[1] - 1)
    before, after = slopes[rows, falls], slopes[rows, rises]
    turns = (before < 0) & (after > 0)
    part = np.where(turns, -before / np.where(turns, after - before, 1), np.where(after <= 0, 1.0, 0.0))
    share = ends[rows, falls] + part * (ends[rows, rises] - ends[rows, falls])
    return norms(_gaps(first + share[:, None] * along, voxels))
