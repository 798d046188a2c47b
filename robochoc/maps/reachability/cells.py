"""The cells of a map, which are values of variables: squares of pixels (`Cells`), or cubes of voxels (`Cubes`).

A cell is free if all pixels that it touches are free, and a robot fits at its centre. Cells are the destinations of
robots. Paths are found on the pixels (`path_lengths.py`), so that robots can pass doors narrower than a cell.

In the map's frame, the coordinates of a cell's centre are whole multiples of its side. So the waypoint of a cell has
integer coordinates, and the side is the scale: integers times scale are exact metres in the map's frame.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from math import ceil, floor
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from robochoc.maps.occupancy.grid import Counts, Flags, OccupancyGrid, summed_area
from robochoc.maps.octomap.voxels import VoxelGrid
from robochoc.maps.reachability.free_space import FreeSpace
from robochoc.system.lazy_dataclass import dataclass

Place = tuple[Fraction, ...]
"""The x and y of a place, and the z on three-dimensional maps, in metres."""


_HAIR = 1e-6
"""The largest overlap that can result from rounding, in pixels."""

_Lengths = npt.NDArray[np.float64]


_HALF = Fraction(1, 2)

_Count = TypeVar("_Count", np.int32, np.int64)
_Numbers = npt.NDArray[np.int64]


_CHECKED_MAX = 10_000
"""The maximum number of cells that are checked individually; a problem cannot have more."""


class CellGrid(ABC):
    """Cells along the axes of a map's frame.

    Cells are numbered from 0, along x first, then along y, and along z on a three-dimensional map, in ascending order.
    """

    side: Fraction
    """The side length of a cell, in metres."""

    @property
    @abstractmethod
    def ends(self) -> Sequence[tuple[Fraction, Fraction]]:
        """The lowest and the highest coordinate of the map on each axis, in metres."""

    @cached_property
    def first(self) -> tuple[int, ...]:
        """The coordinates of cell 0, in cells."""
        return self.containing([low for low, _ in self.ends])

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """The numbers of columns, rows, and levels."""
        behind = [ceil(high / self.side + _HALF) for _, high in self.ends]
        return tuple(end - first for end, first in zip(behind, self.first, strict=True))

    @property
    def columns(self) -> int:
        """The number of columns."""
        return self.counts[0]

    @property
    def rows(self) -> int:
        """The number of rows."""
        return self.counts[1]

    def coordinates(self, cell: int) -> tuple[int, ...]:
        """Return the coordinates of a cell's centre, in cells."""
        found = []
        for first, count in zip(self.first, self.counts, strict=True):
            cell, place = divmod(cell, count)
            found.append(first + place)
        return tuple(found)

    def centre(self, cell: int) -> tuple[Fraction, ...]:
        """Return the place of a cell's centre."""
        return tuple(part * self.side for part in self.coordinates(cell))

    def containing(self, place: Sequence[Fraction]) -> tuple[int, ...]:
        """Return the coordinates of the cell that contains a place, in cells."""
        return tuple(floor(part / self.side + _HALF) for part in place)

    def spans(self, axis: int, corner: Fraction, size: Fraction, parts: int = 1) -> tuple[_Numbers, ...]:
        """Return the first pixel of each column, row or level, the pixel after its last, and the part with its centre.

        Args:
            axis: 0 for columns, 1 for rows, 2 for levels.
            corner: The coordinate at which the first pixel, or voxel, begins.
            size: The side length of a pixel.
            parts: The number of parts into which a pixel is divided.
        """
        found = [
            (
                floor(((number - _HALF) * self.side - corner) / size),
                ceil(((number + _HALF) * self.side - corner) / size),
                floor((number * self.side - corner) / size * parts),
            )
            for number in range(self.first[axis], self.first[axis] + self.counts[axis])
        ]
        return tuple(np.array(found, dtype=np.int64).T)


def sums(table: npt.NDArray[_Count], low: Sequence[_Numbers], high: Sequence[_Numbers]) -> npt.NDArray[_Count]:
    """Return the number of set flags in each cell, given by its first pixel and the pixel after its last on each axis.

    `table` is the summed-area table of the flags.
    """
    found = table
    for axis, (begin, end) in enumerate(zip(low, high, strict=True)):
        last = table.shape[axis] - 1
        found = found.take(end.clip(0, last), axis=axis) - found.take(begin.clip(0, last), axis=axis)
    return found


@dataclass(frozen=True, eq=False)
class Cells(CellGrid):
    """The cells of a two-dimensional map.

    Cells are numbered from 0, row by row, beginning with the lowest y.

    Attributes:
        grid: The map.
        side: The side length of a cell, in metres.
        space: The free space of a robot.
    """

    grid: OccupancyGrid
    side: Fraction
    space: FreeSpace

    @property
    def passable(self) -> Flags:
        """The pixels where the centre of a robot can be."""
        return self.space.passable

    @property
    def ends(self) -> list[tuple[Fraction, Fraction]]:
        """The lowest and the highest coordinate of the map on each axis, in metres."""
        return [(min(ends), max(ends)) for ends in zip(*self.grid.corners, strict=True)]

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The numbers of all free cells."""
        if not self.grid.rotation.is_zero:
            touched, flagged = self._turned.counts(self.grid.free)
            return self._numbers(touched == flagged, self._turned.centres(self.space.parts))
        low, high, middle = zip(self._pixels(1), self._pixels(0), strict=True)
        sizes = np.outer(high[0] - low[0], high[1] - low[1])  # including pixels outside the map, which are not free
        found = sums(self.grid.free_sums, low, high) == sizes
        return self._numbers(found, np.ix_(*middle))

    @cached_property
    def blocked(self) -> tuple[int, ...]:
        """The numbers of all cells with an occupied pixel."""
        if not self.grid.rotation.is_zero:
            return tuple(np.flatnonzero(self._turned.counts(self.grid.occupied)[1]).tolist())
        low, high, _ = zip(self._pixels(1), self._pixels(0), strict=True)
        return tuple(np.flatnonzero(sums(summed_area(self.grid.occupied), low, high)).tolist())

    def centre(self, cell: int) -> tuple[Fraction, Fraction]:
        """Return the place of a cell's centre."""
        x, y = super().centre(cell)
        return x, y

    def pixel(self, place: tuple[Fraction, ...]) -> tuple[int, int] | None:
        """Return the row and the column of the pixel that contains a place; None outside the map."""
        x, y = map(floor, self.grid.in_pixels((place[0], place[1])))
        rows, columns = self.grid.free.shape
        return (y, x) if 0 <= y < rows and 0 <= x < columns else None

    def fits(self, place: tuple[Fraction, ...]) -> bool:
        """Return whether a robot fits at a place on the map."""
        return self.space.fits(self.grid.in_pixels((place[0], place[1])))

    @cached_property
    def _turned(self) -> RotatedSquares:
        return RotatedSquares(self.grid, self.side, (self.first[0], self.first[1]), (self.rows, self.columns))

    def _numbers(self, found: Flags, centres: tuple[npt.NDArray[np.int64], ...]) -> tuple[int, ...]:
        """Return the numbers of the cells in `found` with a centre where a robot fits.

        Centres are given as points on the lattice of the free space.
        """
        height, width = self.space.points.shape
        fits = self.space.points[centres[0].clip(0, height - 1), centres[1].clip(0, width - 1)]
        cells: list[int] = np.flatnonzero(found & fits).tolist()
        is_small = self.side < 2 * self.space.radius * self.grid.resolution  # a robot is larger than a cell
        if is_small and 0 < len(cells) <= _CHECKED_MAX:
            clear = self.space.is_clear([self.grid.in_pixels(self.centre(cell)) for cell in cells])
            cells = [cell for cell, is_clear in zip(cells, clear.tolist(), strict=True) if is_clear]
        return tuple(cells)

    def _pixels(self, axis: int) -> tuple[npt.NDArray[np.int64], ...]:
        """Return the first pixel of each column (`axis` 0) or row, the pixel after its last, and the centre's point."""
        return self.spans(axis, self.grid.origin[axis], self.grid.resolution, self.space.parts)


class RotatedSquares:
    """Finds the pixels in squares that are parallel to the axes of the map's frame, on a map with rotated pixels.

    The pixels that a square touches are found for each row of pixels: a convex figure touches an interval of each row.
    All squares on a map are computed together, in floating point. If a centre is on the border between two pixels,
    within the precision, it is computed again as a fraction.

    Args:
        grid: The map.
        side: The side length of a square, in metres.
        first: The x and y of the first square's centre, in sides of a square.
        shape: The numbers of rows and columns.
    """

    def __init__(self, grid: OccupancyGrid, side: Fraction, first: tuple[int, int], shape: tuple[int, int]) -> None:
        self._grid, self._side, self._first = grid, side, first
        ratio = side / grid.resolution
        self._half = float(ratio / 2) - _HAIR
        self._cosine, self._sine = float(grid.rotation.cosine), float(grid.rotation.sine)
        x, y = (float(part) for part in grid.in_pixels((first[0] * side, first[1] * side)))
        rows, columns = np.indices(shape)
        along, up = float(grid.rotation.cosine * ratio), float(grid.rotation.sine * ratio)
        self._x: _Lengths = x + columns * along + rows * up
        self._y: _Lengths = y + rows * along - columns * up

    def centres(self, parts: int = 1) -> tuple[Counts, Counts]:
        """Return the row and the column of the pixel, or the part of a pixel, at each square's centre.

        Args:
            parts: The number of parts into which the side of a pixel is divided.
        """
        at_x, at_y = parts * self._x, parts * self._y
        x, y = np.floor(at_x).astype(np.int64), np.floor(at_y).astype(np.int64)
        at_border = [np.abs(part - np.rint(part)) < _HAIR for part in (at_x, at_y)]
        for row, column in np.argwhere(at_border[0] | at_border[1]).tolist():
            place = (self._first[0] + column) * self._side, (self._first[1] + row) * self._side
            x[row, column], y[row, column] = (floor(parts * part) for part in self._grid.in_pixels(place))
        return y, x

    def counts(self, flags: Flags) -> tuple[Counts, Counts]:
        """Return the number of pixels touched by each square, also outside the map, and the number of flagged ones."""
        height, width = flags.shape
        sums = np.zeros((height + 2, width + 1), dtype=np.int64)
        np.cumsum(flags, axis=1, out=sums[1:-1, 1:])
        top = self._half * (self._cosine + abs(self._sine))  # the height of a square's highest corner above its centre
        lowest = np.floor(self._y - top).astype(np.int64)
        touched, flagged = np.zeros_like(lowest), np.zeros_like(lowest)
        for number in range(ceil(2 * top) + 1):
            row = lowest + number
            low, high = (np.clip(end - self._y, -top, top) for end in (row, row + 1))
            within = row <= self._y + top
            first = np.floor(self._x + self._furthest_left(low, high)).astype(np.int64)
            last = np.floor(self._x - self._furthest_left(-high, -low)).astype(np.int64)  # a square is symmetric
            touched += np.where(within, last - first + 1, 0)
            line = np.where((row >= 0) & (row < height) & within, row + 1, 0)
            flagged += sums[line, (last + 1).clip(0, width)] - sums[line, first.clip(0, width)]
        return touched, flagged

    def _furthest_left(self, low: _Lengths, high: _Lengths) -> _Lengths:
        """Return the leftmost x of a square between two heights, relative to its centre."""
        cosine, sine, half = self._cosine, self._sine, self._half
        corner = half * (cosine - abs(sine))  # the height of the left corner, or of the right one
        at = np.clip(-corner if sine > 0 else corner, low, high)
        side: _Lengths = np.maximum((sine * at - half) / cosine, ((-half if sine > 0 else half) - cosine * at) / sine)
        return side


@dataclass(frozen=True, eq=False)
class Cubes(CellGrid):
    """The cells of a three-dimensional map.

    Cells are numbered from 0, level by level, and row by row in each level, beginning with the lowest level and y.

    Attributes:
        grid: The map.
        side: The side length of a cell, in metres.
        passable: The voxels where the centre of a robot can be.
    """

    grid: VoxelGrid
    side: Fraction
    passable: Flags

    @property
    def ends(self) -> list[tuple[Fraction, Fraction]]:
        """The lowest and the highest coordinate of the map on each axis, in metres."""
        sizes = [size * self.grid.resolution for size in reversed(self.grid.free.shape)]
        return [(corner, corner + size) for corner, size in zip(self.grid.origin, sizes, strict=True)]

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The numbers of all free cells."""
        (x, xs, column), (y, ys, row), (z, zs, level) = (self._voxels(axis) for axis in range(3))
        sizes = (zs - z)[:, None, None] * (ys - y)[None, :, None] * (xs - x)[None, None, :]
        found = sums(self.grid.free_sums, (z, y, x), (zs, ys, xs)) == sizes
        ends = zip((level, row, column), self.passable.shape, strict=True)
        centres = np.ix_(*(middle.clip(0, size - 1) for middle, size in ends))
        return tuple(np.flatnonzero(found & self.passable[centres]).tolist())

    @cached_property
    def blocked(self) -> tuple[int, ...]:
        """The numbers of all cells with an occupied voxel."""
        return tuple(np.flatnonzero(self._counted(self.grid.occupied_sums)).tolist())

    @property
    def sides(self) -> tuple[int, ...]:
        """The sides of each blocked cell that face cells with free voxels and no occupied ones.

        Bits: 1 towards a lower x and 2 towards a higher x, 4 and 8 for y, 16 and 32 for z.
        """
        occupied = self._counted(self.grid.occupied_sums)
        opened = np.pad((occupied == 0) & (self._counted(self.grid.free_sums) > 0), 1)
        found = np.zeros(occupied.shape, dtype=np.int64)
        for bit, (axis, step) in enumerate((axis, step) for axis in (2, 1, 0) for step in (-1, 1)):
            beside = np.roll(opened, -step, axis=axis)[1:-1, 1:-1, 1:-1]
            found |= beside.astype(np.int64) << bit
        return tuple(found[occupied > 0].tolist())

    def _counted(self, table: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        """Return the number of flagged voxels in each cell."""
        (x, xs, _), (y, ys, _), (z, zs, _) = (self._voxels(axis) for axis in range(3))
        return sums(table, (z, y, x), (zs, ys, xs))

    def pixel(self, place: Place) -> tuple[int, ...] | None:
        """Return the voxel (z, y, x) that contains a place; None outside the map."""
        x, y, z = (floor(part) for part in self.grid.in_voxels(place))
        inside = all(0 <= at < size for at, size in zip((z, y, x), self.grid.free.shape, strict=True))
        return (z, y, x) if inside else None

    def _voxels(self, axis: int) -> tuple[npt.NDArray[np.int64], ...]:
        """Return the first voxel of each column, row or level, the voxel after its last, and the central voxel."""
        return self.spans(axis, self.grid.origin[axis], self.grid.resolution)
