"""The cells of a map: squares of many pixels, which are values of variables.

The centre of a cell lies at whole multiples of its side in the map's frame. So the waypoint of a cell is a pair of
integers, and the side is the scale: integers x scale are metres in the map's frame, exactly.

A cell is free if all pixels that it touches are free, and a robot fits at its centre. Cells are where robots go; how
they get there is found on the pixels (`travel.py`), so that a door narrower than a cell is still a way.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil, floor

import numpy as np
import numpy.typing as npt

from robochoc.formats.occupancy.grid import Counts, Flags, OccupancyGrid, before
from robochoc.formats.occupancy.turn import Place as Place  # noqa: PLC0414 - from here, too
from robochoc.generators.maps.room import Room
from robochoc.generators.maps.turned import TurnedSquares

_HALF = Fraction(1, 2)
_CHECKED_MAX = 10_000
"""Where more cells are found, they are too many, however many of them are a little too near to a wall."""


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of a map.

    Cells are numbered row by row from 0, the row of the lowest y first.

    Attributes:
        grid: The map.
        side: The side of a cell, in metres.
        room: Where a robot fits.
    """

    grid: OccupancyGrid
    side: Fraction
    room: Room

    @property
    def passable(self) -> Flags:
        """The pixels where the centre of a robot can be."""
        return self.room.passable

    @cached_property
    def first(self) -> tuple[int, int]:
        """The x and the y of cell 0, in sides of a cell."""
        x, y = (floor(min(ends) / self.side + _HALF) for ends in zip(*self.grid.corners, strict=True))
        return x, y

    @cached_property
    def columns(self) -> int:
        """The number of columns."""
        return self._count(0)

    @cached_property
    def rows(self) -> int:
        """The number of rows."""
        return self._count(1)

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The numbers of all free cells."""
        if not self.grid.turn.is_none:
            touched, flagged = self._turned.counts(self.grid.free)
            return self._numbers(touched == flagged, self._turned.centres(self.room.parts))
        low, high, middle = zip(self._pixels(1), self._pixels(0), strict=True)
        sizes = np.outer(high[0] - low[0], high[1] - low[1])  # pixels beside the map count, and are not free
        found = _sums(self.grid.free_before, low, high) == sizes
        return self._numbers(found, np.ix_(*middle))

    @cached_property
    def blocked(self) -> tuple[int, ...]:
        """The numbers of all cells with an occupied pixel."""
        if not self.grid.turn.is_none:
            return tuple(np.flatnonzero(self._turned.counts(self.grid.occupied)[1]).tolist())
        low, high, _ = zip(self._pixels(1), self._pixels(0), strict=True)
        return tuple(np.flatnonzero(_sums(before(self.grid.occupied), low, high)).tolist())

    @property
    def counts(self) -> tuple[int, int]:
        """The number of columns and of rows."""
        return self.columns, self.rows

    def coordinates(self, cell: int) -> tuple[int, int]:
        """Return the x and the y of a cell's centre, in sides of a cell."""
        row, column = divmod(cell, self.columns)
        return self.first[0] + column, self.first[1] + row

    def centre(self, cell: int) -> Place:
        """Return the place of a cell's centre."""
        x, y = self.coordinates(cell)
        return x * self.side, y * self.side

    def pixel(self, place: tuple[Fraction, ...]) -> tuple[int, int] | None:
        """Return the row and the column of the pixel of a place; None: it is not on the map."""
        x, y = map(floor, self.grid.in_pixels((place[0], place[1])))
        rows, columns = self.grid.free.shape
        return (y, x) if 0 <= y < rows and 0 <= x < columns else None

    def fits(self, place: tuple[Fraction, ...]) -> bool:
        """Return whether a robot fits at a place on the map."""
        return self.room.fits(self.grid.in_pixels((place[0], place[1])))

    def containing(self, place: tuple[Fraction, ...]) -> tuple[int, int]:
        """Return the x and the y, in sides of a cell, of the cell in which a place lies."""
        x, y = (floor(one / self.side + _HALF) for one in place)
        return x, y

    def _count(self, axis: int) -> int:
        behind: int = ceil(max(corner[axis] for corner in self.grid.corners) / self.side + _HALF)
        return behind - self.first[axis]

    @cached_property
    def _turned(self) -> TurnedSquares:
        return TurnedSquares(self.grid, self.side, self.first, (self.rows, self.columns))

    def _numbers(self, found: Flags, centres: tuple[npt.NDArray[np.int64], ...]) -> tuple[int, ...]:
        """Return the numbers of the cells that are found, where a robot fits at the centre.

        Centres are given by the points of the room's lattice at which they are.
        """
        height, width = self.room.points.shape
        fits = self.room.points[centres[0].clip(0, height - 1), centres[1].clip(0, width - 1)]
        cells: list[int] = np.flatnonzero(found & fits).tolist()
        is_small = self.side < 2 * self.room.radius * self.grid.resolution  # a robot is larger than a cell
        if is_small and 0 < len(cells) <= _CHECKED_MAX:
            clear = self.room.is_clear([self.grid.in_pixels(self.centre(cell)) for cell in cells])
            cells = [cell for cell, is_clear in zip(cells, clear.tolist(), strict=True) if is_clear]
        return tuple(cells)

    def _pixels(self, axis: int) -> tuple[npt.NDArray[np.int64], ...]:
        """Return for each column (`axis` 0) or row its first pixel, the one behind its last, and its centre's point."""
        corner, size, first = self.grid.origin[axis], self.grid.resolution, self.first[axis]
        found = [
            (
                floor(((number - _HALF) * self.side - corner) / size),
                ceil(((number + _HALF) * self.side - corner) / size),
                floor((number * self.side - corner) / size * self.room.parts),
            )
            for number in range(first, first + self._count(axis))
        ]
        return tuple(np.array(found, dtype=np.int64).T)


def _sums(table: Counts, low: tuple[npt.NDArray[np.int64], ...], high: tuple[npt.NDArray[np.int64], ...]) -> Counts:
    """Return how many flags are set in each rectangle of rows `low[0]` to `high[0]` and columns likewise.

    `table` is what `before` returns for the flags.
    """
    height, width = table.shape
    bottom, top = (ends[0].clip(0, height - 1) for ends in (low, high))
    left, right = (ends[1].clip(0, width - 1) for ends in (low, high))
    found: Counts = (
        table[np.ix_(top, right)]
        - table[np.ix_(bottom, right)]
        - table[np.ix_(top, left)]
        + table[np.ix_(bottom, left)]
    )
    return found
