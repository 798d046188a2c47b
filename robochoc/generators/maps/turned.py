"""Cells of a turned map: squares along the axes of the map's frame, on pixels that lie askew.

Which pixels a square touches is found row by row of the pixels: within a row, a convex figure touches an interval of
them. All squares of a map are looked at together, in floating point; where a centre lies on the border of two pixels to
within that precision, it is looked at again, in fractions.
"""

from __future__ import annotations

from fractions import Fraction
from math import ceil, floor

import numpy as np
import numpy.typing as npt

from robochoc.maps.occupancy.grid import Counts, Flags, OccupancyGrid

_HAIR = 1e-6
"""Pixels. What a square touches by less is due to rounding."""

_Numbers = npt.NDArray[np.float64]


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
        self._x: _Numbers = x + columns * along + rows * up
        self._y: _Numbers = y + rows * along - columns * up

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

    def _furthest_left(self, low: _Numbers, high: _Numbers) -> _Numbers:
        """Return where a square reaches furthest to the left between two heights; all is counted from its centre."""
        cosine, sine, half = self._cosine, self._sine, self._half
        corner = half * (cosine - abs(sine))  # the height of the left corner, or of the right one
        at = np.clip(-corner if sine > 0 else corner, low, high)
        side: _Numbers = np.maximum((sine * at - half) / cosine, ((-half if sine > 0 else half) - cosine * at) / sine)
        return side
