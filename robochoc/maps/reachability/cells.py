"""The cells of a map: squares of many pixels, which are values of variables.

A cell is free if all pixels that it touches are free, and a robot fits at its centre. Cells are where robots go; how
they get there is found on the pixels (`path_lengths.py`), so that a door narrower than a cell is still a way.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil, floor
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from robochoc.maps.occupancy.grid import Counts, Flags, OccupancyGrid, before
from robochoc.maps.octomap.voxels import VoxelGrid
from robochoc.maps.reachability.free_space import FreeSpace

Place = tuple[Fraction, ...]
"""The x and the y of a place in metres, and on three-dimensional maps its z."""


_HAIR = 1e-6
"""Pixels. What a square touches by less is due to rounding."""

_Lengths = npt.NDArray[np.float64]


_HALF = Fraction(1, 2)

_Count = TypeVar("_Count", np.int32, np.int64)
_Numbers = npt.NDArray[np.int64]


_CHECKED_MAX = 10_000
"""The maximum number of cells that are checked individually. More cells are too many for a problem."""


class CellGrid(ABC):
    """Cells along the axes of a map's frame.

    They are numbered from 0, along x first, then along y, and along z where the map has it; the lowest ones first.
    """

    side: Fraction
    """The side of a cell, in metres."""

    @property
    @abstractmethod
    def ends(self) -> Sequence[tuple[Fraction, Fraction]]:
        """For each axis the lowest and the highest coordinate of the map, in metres."""

    @cached_property
    def first(self) -> tuple[int, ...]:
        """The coordinates of cell 0, in sides of a cell."""
        return self.containing([low for low, _ in self.ends])

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """The number of columns, of rows, and of levels."""
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
        """Return the coordinates of a cell's centre, in sides of a cell."""
        found = []
        for first, count in zip(self.first, self.counts, strict=True):
            cell, place = divmod(cell, count)
            found.append(first + place)
        return tuple(found)

    def centre(self, cell: int) -> tuple[Fraction, ...]:
        """Return the place of a cell's centre."""
        return tuple(part * self.side for part in self.coordinates(cell))

    def containing(self, place: Sequence[Fraction]) -> tuple[int, ...]:
        """Return the coordinates, in sides of a cell, of the cell in which a place lies."""
        return tuple(floor(part / self.side + _HALF) for part in place)

    def spans(self, axis: int, corner: Fraction, size: Fraction, parts: int = 1) -> tuple[_Numbers, ...]:
        """Return for each column, row or level its first pixel, the one behind its last, and where its centre is.

        Args:
            axis: 0 for columns, 1 for rows, 2 for levels.
            corner: Where the first pixel, or voxel, begins.
            size: The side of a pixel.
            parts: Into how many parts a pixel is cut, of which one has the centre.
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
    """Return how many flags are set in each cell, between its first pixel along each axis and the one behind its last.

    `table` has for each corner of a pixel how many flags before it are set (a summed-area table).
    """
    found = table
    for axis, (begin, end) in enumerate(zip(low, high, strict=True)):
        last = table.shape[axis] - 1
        found = found.take(end.clip(0, last), axis=axis) - found.take(begin.clip(0, last), axis=axis)
    return found


@dataclass(frozen=True, eq=False)
class Cells(CellGrid):
    """The cells of a map.

    Cells are numbered row by row from 0, the row of the lowest y first.

    Attributes:
        grid: The map.
        side: The side of a cell, in metres.
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
        """For each axis the lowest and the highest coordinate of the map, in metres."""
        return [(min(ends), max(ends)) for ends in zip(*self.grid.corners, strict=True)]

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The numbers of all free cells."""
        if not self.grid.turn.is_none:
            touched, flagged = self._turned.counts(self.grid.free)
            return self._numbers(touched == flagged, self._turned.centres(self.space.parts))
        low, high, middle = zip(self._pixels(1), self._pixels(0), strict=True)
        sizes = np.outer(high[0] - low[0], high[1] - low[1])  # pixels beside the map count, and are not free
        found = sums(self.grid.free_before, low, high) == sizes
        return self._numbers(found, np.ix_(*middle))

    @cached_property
    def blocked(self) -> tuple[int, ...]:
        """The numbers of all cells with an occupied pixel."""
        if not self.grid.turn.is_none:
            return tuple(np.flatnonzero(self._turned.counts(self.grid.occupied)[1]).tolist())
        low, high, _ = zip(self._pixels(1), self._pixels(0), strict=True)
        return tuple(np.flatnonzero(sums(before(self.grid.occupied), low, high)).tolist())

    def centre(self, cell: int) -> tuple[Fraction, Fraction]:
        """Return the place of a cell's centre."""
        x, y = super().centre(cell)
        return x, y

    def pixel(self, place: tuple[Fraction, ...]) -> tuple[int, int] | None:
        """Return the row and the column of the pixel of a place; None: it is not on the map."""
        x, y = map(floor, self.grid.in_pixels((place[0], place[1])))
        rows, columns = self.grid.free.shape
        return (y, x) if 0 <= y < rows and 0 <= x < columns else None

    def fits(self, place: tuple[Fraction, ...]) -> bool:
        """Return whether a robot fits at a place on the map."""
        return self.space.fits(self.grid.in_pixels((place[0], place[1])))

    @cached_property
    def _turned(self) -> TurnedSquares:
        return TurnedSquares(self.grid, self.side, (self.first[0], self.first[1]), (self.rows, self.columns))

    def _numbers(self, found: Flags, centres: tuple[npt.NDArray[np.int64], ...]) -> tuple[int, ...]:
        """Return the numbers of the cells that are found, where a robot fits at the centre.

        Centres are given by the points of the room's lattice at which they are.
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
        """Return for each column (`axis` 0) or row its first pixel, the one behind its last, and its centre's point."""
        return self.spans(axis, self.grid.origin[axis], self.grid.resolution, self.space.parts)


class TurnedSquares:
    """Squares of a turned map, in columns and rows.

    Args:
        grid: The map.
        side: The side of a square, in metres.
        first: The x and the y of the first square's centre, in sides.
        shape: The number of rows and of columns.
    """

    def __init__(self, grid: OccupancyGrid, side: Fraction, first: tuple[int, int], shape: tuple[int, int]) -> None:
        self._grid, self._side, self._first = grid, side, first
        ratio = side / grid.resolution
        self._half = float(ratio / 2) - _HAIR
        self._cosine, self._sine = float(grid.turn.cosine), float(grid.turn.sine)
        x, y = (float(part) for part in grid.in_pixels((first[0] * side, first[1] * side)))
        rows, columns = np.indices(shape)
        along, up = float(grid.turn.cosine * ratio), float(grid.turn.sine * ratio)
        self._x: _Lengths = x + columns * along + rows * up
        self._y: _Lengths = y + rows * along - columns * up

    def centres(self, parts: int = 1) -> tuple[Counts, Counts]:
        """Return the row and the column of the pixel at each square's centre, or of the part of a pixel there.

        Args:
            parts: Into how many parts a pixel's side is cut.
        """
        at_x, at_y = parts * self._x, parts * self._y
        x, y = np.floor(at_x).astype(np.int64), np.floor(at_y).astype(np.int64)
        at_border = [np.abs(part - np.rint(part)) < _HAIR for part in (at_x, at_y)]
        for row, column in np.argwhere(at_border[0] | at_border[1]).tolist():
            place = (self._first[0] + column) * self._side, (self._first[1] + row) * self._side
            x[row, column], y[row, column] = (floor(parts * part) for part in self._grid.in_pixels(place))
        return y, x

    def counts(self, flags: Flags) -> tuple[Counts, Counts]:
        """Return the number of pixels that each square touches, also outside the map, and how many are flagged."""
        height, width = flags.shape
        sums = np.zeros((height + 2, width + 1), dtype=np.int64)
        np.cumsum(flags, axis=1, out=sums[1:-1, 1:])
        top = self._half * (self._cosine + abs(self._sine))  # how far a square's highest corner is above its centre
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
        """Return where a square reaches furthest to the left between two heights; all is counted from its centre."""
        cosine, sine, half = self._cosine, self._sine, self._half
        corner = half * (cosine - abs(sine))  # the height of the left corner, or of the right one
        at = np.clip(-corner if sine > 0 else corner, low, high)
        side: _Lengths = np.maximum((sine * at - half) / cosine, ((-half if sine > 0 else half) - cosine * at) / sine)
        return side


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
