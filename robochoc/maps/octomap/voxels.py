"""Voxels of three-dimensional maps: which are free, which are occupied, and which nobody knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import prod
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robochoc.formats.diagnostics import MistakeError
from robochoc.maps.map_content import content_of, told
from robochoc.maps.occupancy.grid import Flags
from robochoc.maps.octomap.octree import DEPTH, MAX_BYTES, Corners, Integers, Leaves, Octree, read_octree

MAX_VOXELS = 16_000_000
"""The maximum number of voxels around all that is free. A larger map is read coarser."""
_FREE, _OCCUPIED = 1, 2

Corner = tuple[Fraction, Fraction, Fraction]
States = npt.NDArray[np.uint8]
Sums = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """A three-dimensional map, as far as anything in it is free, and a voxel further. Lengths are in metres.

    Attributes:
        name: The name of its file, without the ending.
        resolution: The side of a voxel.
        origin: The x, y and z of the lowest corner.
        free: Which voxels are free: by z, then y, then x, each from the lowest on.
        occupied: Which are occupied. A voxel that is neither is not known.
    """

    name: str
    resolution: Fraction
    origin: Corner
    free: Flags
    occupied: Flags

    @cached_property
    def free_before(self) -> Sums:
        """For each corner of a voxel, how many voxels with a smaller x, y and z are free (a summed-volume table)."""
        return _before(self.free)

    @cached_property
    def occupied_before(self) -> Sums:
        """The same of occupied voxels."""
        return _before(self.occupied)

    def in_voxels(self, place: tuple[Fraction, ...]) -> Corner:
        """Return where a place lies, in voxels from the lowest corner."""
        x, y, z = ((part - corner) / self.resolution for part, corner in zip(place, self.origin, strict=True))
        return x, y, z


def read_voxels(path: Path) -> VoxelGrid:
    """Return the map in one of OctoMap's files.

    Where that has more than `MAX_VOXELS`, its voxels are joined, eight by eight: one is free if all of it is free, and
    occupied if any of it is.

    Raises:
        InvalidInputError: The file cannot be read, is no such file, is too large, or has nothing that is free.
    """
    with told(path):
        return _voxels(path.stem, read_octree(content_of(path, MAX_BYTES)))


def _voxels(name: str, tree: Octree) -> VoxelGrid:
    if all(leaves.occupied.all() for leaves in tree.leaves):
        raise MistakeError("has no free voxel", "free space has to be mapped, too, as OctoMap does along its rays")
    exponent = 0
    while True:
        low, high = _around_free(tree.leaves, exponent)
        if prod((high - low).tolist()) <= MAX_VOXELS:
            break
        exponent += 1
    states = _states(tree.leaves, exponent, low, high)
    side = tree.resolution * 2**exponent
    x, y, z = ((int(part) - 2 ** (DEPTH - 1 - exponent)) * side if exponent < DEPTH else -side / 2 for part in low)
    if not (states == _FREE).any():
        raise MistakeError(f"has more than {MAX_VOXELS:,} voxels, and no free cube of {float(side):g} m", "crop it")
    return VoxelGrid(name, side, (x, y, z), states == _FREE, states == _OCCUPIED)


def _around_free(leaves: Sequence[Leaves], exponent: int) -> tuple[Integers, Integers]:
    """Return the first voxel around all that is free along x, y and z, and the one behind the last."""
    lows, highs = [], []
    for some in leaves:
        corners = some.corners[~some.occupied]
        if corners.size:
            first, last = (end.astype(np.int64) for end in (corners.min(axis=0), corners.max(axis=0)))
            lows.append((first << some.exponent) >> exponent)
            highs.append(((((last + 1) << some.exponent) - 1) >> exponent) + 1)
    most = 1 << (DEPTH - exponent)
    return (np.min(lows, axis=0) - 1).clip(0), (np.max(highs, axis=0) + 1).clip(None, most)


def _states(leaves: Sequence[Leaves], exponent: int, low: Integers, high: Integers) -> States:
    """Return which voxels are free and which are occupied, by z, y and x.

    It begins with the whole tree as one voxel. They are halved until they have the size that is asked for.
    """
    by_size = {some.exponent: some for some in leaves}
    states = np.zeros((1, 1, 1), dtype=np.uint8)
    first = np.zeros(3, dtype=np.int64)
    for size in range(DEPTH, exponent - 1, -1):
        begin, end = low >> (size - exponent), ((high - 1) >> (size - exponent)) + 1
        if size < DEPTH:
            for axis in range(3):
                states = states.repeat(2, axis=axis)
            first = 2 * first
            x, y, z = (slice(a, b) for a, b in zip((begin - first).tolist(), (end - first).tolist(), strict=True))
            states, first = states[z, y, x], begin
        if size in by_size:
            some = by_size[size]
            inside = ((some.corners >= begin) & (some.corners < end)).all(axis=1)
            states[_places(some.corners[inside], begin)] = np.where(some.occupied[inside], _OCCUPIED, _FREE)
    if exponent:
        _join([some for some in leaves if some.exponent < exponent], exponent, states, low, high)
    return states


def _join(leaves: Sequence[Leaves], exponent: int, states: States, low: Integers, high: Integers) -> None:
    """Write into the states what leaves that are smaller than a voxel make of it."""
    free = np.zeros(states.size, dtype=np.int64)
    """The free part of each voxel."""
    for some in leaves:
        corners: Corners = some.corners >> np.uint16(exponent - some.exponent)
        inside = ((corners >= low) & (corners < high)).all(axis=1)
        states[_places(corners[inside & some.occupied], low)] = _OCCUPIED
        z, y, x = _places(corners[inside & ~some.occupied], low)
        kept = (z * states.shape[1] + y) * states.shape[2] + x
        free += np.bincount(kept, minlength=states.size) * 8**some.exponent
    states[(free == 8**exponent).reshape(states.shape)] = _FREE


def _places(corners: Corners, first: Integers) -> tuple[Sums, Sums, Sums]:
    """Return the places of voxels in an array by z, y and x that begins with a first one."""
    z, y, x = (corners[:, axis].astype(np.int32) - np.int32(first[axis]) for axis in (2, 1, 0))
    return z, y, x


def _before(flags: Flags) -> Sums:
    sums = np.pad(flags, ((1, 0),) * 3).astype(np.int32)
    for axis in range(3):
        np.cumsum(sums, axis=axis, out=sums)
    return sums
