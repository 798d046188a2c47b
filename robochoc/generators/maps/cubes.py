"""The cells of a three-dimensional map: cubes of many voxels, which are values of variables.

As those of a grid (`cells.py`): a cell is free if all voxels that it touches are, and a robot fits at its centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import floor

import numpy as np
import numpy.typing as npt

from robochoc.generators.maps.cell_grid import CellGrid, sums
from robochoc.maps.occupancy.grid import Flags
from robochoc.maps.octomap.voxels import VoxelGrid

Place = tuple[Fraction, ...]
"""The x, y and z of a place, in metres."""


@dataclass(frozen=True, eq=False)
class Cubes(CellGrid):
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

    @property
    def ends(self) -> list[tuple[Fraction, Fraction]]:
        """For each axis the lowest and the highest coordinate of the map, in metres."""
        sizes = [size * self.grid.resolution for size in reversed(self.grid.free.shape)]
        return [(corner, corner + size) for corner, size in zip(self.grid.origin, sizes, strict=True)]

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The numbers of all free cells."""
        (x, xs, column), (y, ys, row), (z, zs, level) = (self._voxels(axis) for axis in range(3))
        sizes = (zs - z)[:, None, None] * (ys - y)[None, :, None] * (xs - x)[None, None, :]
        found = sums(self.grid.free_before, (z, y, x), (zs, ys, xs)) == sizes
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

    def _counted(self, table: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        """Return how many voxels of each cell have a flag."""
        (x, xs, _), (y, ys, _), (z, zs, _) = (self._voxels(axis) for axis in range(3))
        return sums(table, (z, y, x), (zs, ys, xs))

    def pixel(self, place: Place) -> tuple[int, ...] | None:
        """Return the voxel of a place by z, y and x; None: it is not on the map."""
        x, y, z = (floor(part) for part in self.grid.in_voxels(place))
        inside = all(0 <= at < size for at, size in zip((z, y, x), self.grid.free.shape, strict=True))
        return (z, y, x) if inside else None

    def _voxels(self, axis: int) -> tuple[npt.NDArray[np.int64], ...]:
        """Return for each column, row or level its first voxel, the one behind its last, and that of its centre."""
        return self.spans(axis, self.grid.origin[axis], self.grid.resolution)
