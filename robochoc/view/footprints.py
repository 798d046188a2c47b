"""Walls of a map, to be drawn: pixels merged into few rectangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robochoc.flight.mission import Mission, in_cells
from robochoc.maps.walls import PixelFrame

_MOST = 4_000
"""Rectangles of a map. Where there would be more, pixels are drawn twice as large, and again."""

Corners = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class DrawnWalls:
    """The footprints of walls, and of what nobody knows: for each rectangle its corners (4, 2), counterclockwise."""

    occupied: Corners
    unknown: Corners


def walls_drawn(mission: Mission) -> DrawnWalls | None:
    """Return the walls of a mission in the cells of its box; None if it has none in the plane."""
    walls = mission.walls
    frame = walls.frame if walls else None
    if walls is None or not isinstance(frame, PixelFrame):
        return None

    def footprints(flags: Flags) -> Corners:
        sides, factor = few_rectangles(flags)
        left, low, right, high = factor * sides.T
        corners = np.stack([left, low, right, low, right, high, left, high], axis=1).reshape(-1, 2)
        rows, columns = flags.shape
        places = frame.in_metres(np.minimum(corners, (columns, rows)).astype(np.float64))
        flat = np.column_stack((places, np.zeros(len(places))))
        return in_cells(mission, flat)[:, :2].reshape(-1, 4, 2)

    return DrawnWalls(footprints(walls.occupied), footprints(walls.unknown))


def few_rectangles(flags: Flags, most: int = _MOST) -> tuple[Numbers, int]:
    """Return rectangles that cover the flags, no more than `most`, and how many pixels wide their unit is."""
    factor = 1
    while len(found := rectangles(flags)) > most:
        factor *= 2
        rows, columns = flags.shape
        even = np.pad(flags, ((0, rows % 2), (0, columns % 2)))
        flags = even[::2, ::2] | even[1::2, ::2] | even[::2, 1::2] | even[1::2, 1::2]
    return found, factor


def rectangles(flags: Flags) -> Numbers:
    """Return rectangles (K, 4) that cover exactly the flags that are set: the least x and y, and those beyond the last.

    Runs of pixels in a row are one, and equal runs in rows one above the other.
    """
    steps = np.diff(np.pad(flags, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, begin = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    order = np.lexsort((row, end, begin))
    row, begin, end = row[order], begin[order], end[order]
    new = np.ones(len(row), dtype=bool)
    new[1:] = (np.diff(begin) != 0) | (np.diff(end) != 0) | (np.diff(row) != 1)
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(row)) - 1 if len(first) else first
    return np.column_stack((begin[first], row[first], end[first], row[last] + 1)).astype(np.int64)
