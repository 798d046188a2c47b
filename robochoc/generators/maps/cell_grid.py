"""Numbers, places and pixels of the cells of a map, in the plane and in space.

The centre of a cell lies at whole multiples of its side in the map's frame. So the waypoint of a cell has integers as
coordinates, and the side is the scale: integers x scale are metres in the map's frame, exactly.
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

_HALF = Fraction(1, 2)

_Count = TypeVar("_Count", np.int32, np.int64)
_Numbers = npt.NDArray[np.int64]


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
