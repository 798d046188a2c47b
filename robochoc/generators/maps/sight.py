"""Which cells can be seen from which, along straight lines that touch nothing but free pixels.

All is exact: places are integers in a unit of which a pixel has a whole number. So what sees is seen, and a line that
just touches the corner of a wall is blocked on every machine.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from itertools import combinations
from math import lcm

import numpy as np
import numpy.typing as npt

from robochoc.generators.maps.cells import Cells

MAX_PAIRS = 100_000
"""The maximum number of pairs of cells within the sensing range."""

Point = tuple[int, int]


class Sight:
    """Lines of sight between the free cells of a map."""

    def __init__(self, cells: Cells) -> None:
        self._cells = cells
        places = [self._in_pixels(cell) for cell in cells.free]
        self._unit = lcm(1, *(part.denominator for place in places for part in place))
        """The length of a pixel's side."""
        self._points: dict[int, Point] = {
            cell: (int(x * self._unit), int(y * self._unit)) for cell, (x, y) in zip(cells.free, places, strict=True)
        }

    def seen(self, sensing: Fraction) -> dict[int, frozenset[int]]:
        """Return the cells that are seen from each free cell: those within a range in metres, itself among them.

        Raises:
            ValueError: More than `MAX_PAIRS` pairs of cells are that near.
        """
        reach = (sensing / self._cells.grid.resolution * self._unit) ** 2
        near = [
            (one, other)
            for (one, (a, b)), (other, (c, d)) in combinations(self._points.items(), 2)
            if (a - c) ** 2 + (b - d) ** 2 <= reach
        ]
        if len(near) > MAX_PAIRS:
            raise ValueError(
                f"{len(near):,} pairs of cells are within the sensing range, more than {MAX_PAIRS:,};"
                " take larger cells, or less of sensing"
            )
        found = {cell: {cell} for cell in self._points}
        for one, other in near:
            if self.is_clear(one, other):
                found[one].add(other)
                found[other].add(one)
        return {cell: frozenset(others) for cell, others in found.items()}

    def is_clear(self, one: int, other: int) -> bool:
        """Return whether the straight line between two free cells touches free pixels only."""
        (x, y), (right, end) = sorted((self._points[one], self._points[other]))
        unit, across, up = self._unit, right - x, end - y
        solid = self._solid
        for column in range(_first_touched(x, unit), right // unit + 1):
            if across:
                # The heights at the borders of the column, times `across`: fractions would be slower.
                left = max(x, column * unit) - x
                back = min(right, (column + 1) * unit) - x
                low, high = sorted((y * across + left * up, y * across + back * up))
                size = unit * across
            else:
                (low, high), size = sorted((y, end)), unit
            if solid[high // size + 1, column] > solid[_first_touched(low, size), column]:
                return False
        return True

    @cached_property
    def _solid(self) -> npt.NDArray[np.int64]:
        """The number of pixels that are not free below each row, by column."""
        return np.cumsum(np.pad(~self._cells.grid.free, ((1, 0), (0, 0))), axis=0, dtype=np.int64)

    def _in_pixels(self, cell: int) -> tuple[Fraction, Fraction]:
        """Return the place of a cell's centre, in pixels from the lower left corner of the map."""
        return self._cells.grid.in_pixels(self._cells.centre(cell))


def _first_touched(place: int, size: int) -> int:
    """Return the first pixel that touches a place, where pixels have that size: on a border it is the one before."""
    return -(-place // size) - 1
