"""The cells of a three-dimensional map: cubes of many voxels, which are values of variables.

As those of a grid (`cells.py`): centres lie at whole multiples of the side in the map's frame, a cell is free if all
voxels that it touches are, and a robot fits at its centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil, floor

import numpy as np
import numpy.typing as npt

from robochoc.formats.occupancy.grid import Flags
from robochoc.formats.octomap.voxels import VoxelGrid

_HALF = Fraction(1, 2)

Place = tuple[Fraction, ...]
"""The x, y and z of a place, in metres."""
_Sums = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Cubes:
    """The cells of a three-dimensional map.

    Cells are numbered level by level from 0, in each row by row, the lowest level and the lowest y first.

    Attributes:
        grid: The map.
        side: The side of a cell, in metres.
        passable: The voxels where the centre of a robot can be.
    """

    grid: VoxelGrid
    side: Fraction
    passable: Flags

    @cached_property
    def first(self) -> tuple[int, int, int]:
        """The x, y and z of cell 0, in sides of a cell."""
        x, y, z = (floor(corner / self.side + _HALF) for corner in self.grid.origin)
        return x, y, z

    @cached_property
    def counts(self) -> tuple[int, int, int]:
        """The number of columns, of rows and of levels."""
        ends = (
            corner + size * self.grid.resolution
            for corner, size in zip(self.grid.origin, reversed(self.grid.free.shape), strict=True)
        )
        x, y, z = (ceil(end / self.side + _HALF) - first for end, first in zip(ends, self.first, strict=True))
        return x, y, z

    @property
    def columns(self) -> int:
        """The number of columns."""
        return self.counts[0]

    @property
    def rows(self) -> int:
        """The number of rows."""
        return self.counts[1]

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The numbers of all free cells."""
        (x, xs, column), (y, ys, row), (z, zs, level) = (self._voxels(axis) for axis in range(3))
        sizes = (zs - z)[:, None, None] * (ys - y)[None, :, None] * (xs - x)[None, None, :]
        found = _sums(self.grid.free_before, (z, y, x), (zs, ys, xs)) == sizes
        ends = zip((level, row, column), self.passable.shape, strict=True)
        centres = np.ix_(*(middle.clip(0, size - 1) for middle, size in ends))
        return tuple(np.flatnonzero(found & self.passable[centres]).tolist())

    @cached_property
    def blocked(self) -> tuple[int, ...]:
        """The numbers of all cells with an occupied voxel."""
        return tuple(np.flatnonzero(self._counted(self.grid.occupied_before)).tolist())

    @property
    def sides(self) -> tuple[int, ...]:
        """For each blocked cell the sides beyond which a cell has free voxels, and none that is occupied.

        Bits: 1 towards a lower x and 2 towards a higher one, 4 and 8 for y, 16 and 32 for z.
        """
        occupied = self._counted(self.grid.occupied_before)
        opened = np.pad((occupied == 0) & (self._counted(self.grid.free_before) > 0), 1)
        found = np.zeros(occupied.shape, dtype=np.int64)
        for bit, (axis, step) in enumerate((axis, step) for axis in (2, 1, 0) for step in (-1, 1)):
            beside = np.roll(opened, -step, axis=axis)[1:-1, 1:-1, 1:-1]
            found |= beside.astype(np.int64) << bit
        return tuple(found[occupied > 0].tolist())

    def _counted(self, table: _Sums) -> _Sums:
        """Return how many voxels of each cell have a flag."""
        (x, xs, _), (y, ys, _), (z, zs, _) = (self._voxels(axis) for axis in range(3))
        return _sums(table, (z, y, x), (zs, ys, xs))

    def coordinates(self, cell: int) -> tuple[int, int, int]:
        """Return the x, y and z of a cell's centre, in sides of a cell."""
        columns, rows, _ = self.counts
        level, place = divmod(cell, columns * rows)
        row, column = divmod(place, columns)
        return self.first[0] + column, self.first[1] + row, self.first[2] + level

    def centre(self, cell: int) -> Place:
        """Return the place of a cell's centre."""
        return tuple(part * self.side for part in self.coordinates(cell))

    def pixel(self, place: Place) -> tuple[int, ...] | None:
        """Return the voxel of a place by z, y and x; None: it is not on the map."""
        x, y, z = (floor(part) for part in self.grid.in_voxels(place))
        inside = all(0 <= at < size for at, size in zip((z, y, x), self.grid.free.shape, strict=True))
        return (z, y, x) if inside else None

    def containing(self, place: Place) -> tuple[int, int, int]:
        """Return the x, y and z, in sides of a cell, of the cell in which a place lies."""
        x, y, z = (floor(part / self.side + _HALF) for part in place)
        return x, y, z

    def _voxels(self, axis: int) -> tuple[npt.NDArray[np.int64], ...]:
        """Return for each column, row or level its first voxel, the one behind its last, and that of its centre."""
        corner, size, first = self.grid.origin[axis], self.grid.resolution, self.first[axis]
        found = [
            (
                floor(((number - _HALF) * self.side - corner) / size),
                ceil(((number + _HALF) * self.side - corner) / size),
                floor((number * self.side - corner) / size),
            )
            for number in range(first, first + self.counts[axis])
        ]
        return tuple(np.array(found, dtype=np.int64).T)


def _sums(table: _Sums, low: tuple[npt.NDArray[np.int64], ...], high: tuple[npt.NDArray[np.int64], ...]) -> _Sums:
    """Return how many flags are set between `low` and `high`, by level, row and column. `table` has sums."""
    found = table
    for axis, (begin, end) in enumerate(zip(low, high, strict=True)):
        last = table.shape[axis] - 1
        found = found.take(end.clip(0, last), axis=axis) - found.take(begin.clip(0, last), axis=axis)
    return found
