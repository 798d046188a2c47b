"""The cells of a map: squares of many pixels, which are values of variables.

A cell is free if all pixels that it touches are free, and a robot fits at its centre. Cells are where robots go; how
they get there is found on the pixels (`travel.py`), so that a door narrower than a cell is still a way.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import floor

import numpy as np
import numpy.typing as npt

from robochoc.generators.maps.cell_grid import CellGrid, sums
from robochoc.generators.maps.room import Room
from robochoc.generators.maps.turned import TurnedSquares
from robochoc.maps.occupancy.grid import Flags, OccupancyGrid, before
from robochoc.maps.occupancy.turn import Place as Place  # noqa: PLC0414 - from here, too

_CHECKED_MAX = 10_000
"""The maximum number of cells that are checked individually. More cells are too many for a problem."""


@dataclass(frozen=True, eq=False)
class Cells(CellGrid):
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

    @property
    def ends(self) -> list[tuple[Fraction, Fraction]]:
        """For each axis the lowest and the highest coordinate of the map, in metres."""
        return [(min(ends), max(ends)) for ends in zip(*self.grid.corners, strict=True)]

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The numbers of all free cells."""
        if not self.grid.turn.is_none:
            touched, flagged = self._turned.counts(self.grid.free)
            return self._numbers(touched == flagged, self._turned.centres(self.room.parts))
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

    def centre(self, cell: int) -> Place:
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
        return self.room.fits(self.grid.in_pixels((place[0], place[1])))

    @cached_property
    def _turned(self) -> TurnedSquares:
        return TurnedSquares(self.grid, self.side, (self.first[0], self.first[1]), (self.rows, self.columns))

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
        return self.spans(axis, self.grid.origin[axis], self.grid.resolution, self.room.parts)
