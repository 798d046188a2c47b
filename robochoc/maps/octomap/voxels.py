"""The free, occupied and unknown voxels of three-dimensional maps."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from math import prod
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robochoc.formats.diagnostics import MistakeError
from robochoc.maps.file_content import as_input_errors, read_content
from robochoc.maps.occupancy.grid import Flags
from robochoc.maps.octomap.octree import DEPTH, MAX_BYTES, Corners, Integers, Leaves, Octree, read_octree
from robochoc.system.lazy_dataclass import dataclass

MAX_VOXELS = 16_000_000
"""The maximum number of voxels around all free space. A larger map is read with larger voxels."""
_FREE, _OCCUPIED = 1, 2

Corner = tuple[Fraction, Fraction, Fraction]
States = npt.NDArray[np.uint8]
Sums = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """A three-dimensional map, cut to its free space and one more voxel on each side. Lengths are in metres.

    Attributes:
        name: The name of the file, without its extension.
        resolution: The side length of a voxel.
        origin: The x, y and z of the lowest corner.
        free: Which voxels are free, sorted by z, then y, then x.
        occupied: Which voxels are occupied. A voxel that is neither free nor occupied is unknown.
    """

    name: str
    resolution: Fraction
    origin: Corner
    free: Flags
    occupied: Flags

    @cached_property
    def free_sums(self) -> Sums:
        """The number of free voxels with smaller x, y and z, for each corner of a voxel (a summed-volume table)."""
        return _summed_volume(self.free)

    @cached_property
    def occupied_sums(self) -> Sums:
        """The number of occupied voxels with smaller x, y and z, for each corner of a voxel."""
        return _summed_volume(self.occupied)

    def in_voxels(self, place: tuple[Fraction, ...]) -> Corner:
        """Return a place in voxels from the lowest corner."""
        x, y, z = ((part - corner) / self.resolution for part, corner in zip(place, self.origin, strict=True))
        return x, y, z


def read_voxels(path: Path) -> VoxelGrid:
    """Return the map in an OctoMap file.

    If the map has more than `MAX_VOXELS`, groups of eight voxels are joined: the result is free if all parts are free,
    and occupied if any part is occupied.

    Raises:
        InvalidInputError: The file cannot be read, is not valid, is too large, or has no free voxel.
    """
    with as_input_errors(path):
        return _voxels(path.stem, read_octree(read_content(path, MAX_BYTES)))


def _voxels(name: str, tree: Octree) -> VoxelGrid:
    if all(leaves.occupied.all() for leaves in tree.leaves):
        raise MistakeError("has no free voxel", "map the free space as well, as OctoMap does along its rays")
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
    """Return the first voxel around all free space along x, y and z, and the voxel after the last."""
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
    """Return the states of voxels (free, occupied or unknown), by z, y and x.

    At first, the whole tree is one voxel; the sides of voxels are halved until they have the required size.
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
        _merge_small_leaves([some for some in leaves if some.exponent < exponent], exponent, states, low, high)
    return states


def _merge_small_leaves(leaves: Sequence[Leaves], exponent: int, states: States, low: Integers, high: Integers) -> None:
    """Set the states of voxels that consist of smaller leaves."""
    free = np.zeros(states.size, dtype=np.int64)
    """The free volume of each voxel."""
    for some in leaves:
        corners: Corners = some.corners >> np.uint16(exponent - some.exponent)
        inside = ((corners >= low) & (corners < high)).all(axis=1)
        states[_places(corners[inside & some.occupied], low)] = _OCCUPIED
        z, y, x = _places(corners[inside & ~some.occupied], low)
        kept = (z * states.shape[1] + y) * states.shape[2] + x
        free += np.bincount(kept, minlength=states.size) * 8**some.exponent
    states[(free == 8**exponent).reshape(states.shape)] = _FREE


def _places(corners: Corners, first: Integers) -> tuple[Sums, Sums, Sums]:
    """Return the indices of voxels in an array by z, y and x that begins with the voxel `first`."""
    z, y, x = (corners[:, axis].astype(np.int32) - np.int32(first[axis]) for axis in (2, 1, 0))
    return z, y, x


def _summed_volume(flags: Flags) -> Sums:
    sums = np.pad(flags, ((1, 0),) * 3).astype(np.int32)
    for axis in range(3):
        np.cumsum(sums, axis=axis, out=sums)
    return sums
