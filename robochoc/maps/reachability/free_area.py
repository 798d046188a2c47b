"""The forbidden area of a robot on a map, as rectangles: where it does not fit, and what it cannot reach.

The area consists of whole pixels. In all other pixels, the robot fits at every point, with a margin for the routes of
flights, and it can get there from its start.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from robochoc.maps.occupancy.grid import Flags, OccupancyGrid
from robochoc.maps.occupancy.rectangles import few_rectangles
from robochoc.maps.reachability.cell_size import in_pixels
from robochoc.maps.reachability.cells import Cells
from robochoc.maps.reachability.free_space import free_space
from robochoc.maps.reachability.path_lengths import UNREACHED, lengths_from

MARGIN_M = Fraction(6, 100)
"""The margin beyond the radius with which flights keep away from walls, if there is room."""
MOST_RECTANGLES = 100
"""The maximum number of rectangles. If there are more, the size of pixels is doubled until it is met."""

Span = tuple[Fraction, Fraction]
Rectangle = tuple[Span, Span]
"""The lowest and the highest x, and the lowest and the highest y, in metres."""


def free_pixels(cells: Cells, radius: Fraction) -> Flags:
    """Return the pixels in which a robot fits at every point, with a margin."""
    grid = cells.grid
    return free_space(grid.free, in_pixels(radius + MARGIN_M, grid.resolution)).is_whole


def reached_pixels(cells: Cells, start: tuple[int, int]) -> Flags:
    """Return the pixels that a robot can reach from a pixel."""
    return np.asarray(lengths_from(start, cells.passable, joined=cells.space.joined) != UNREACHED)


def bounds_of(grid: OccupancyGrid, flags: Flags) -> Rectangle:
    """Return the smallest rectangle around the set pixels, at least one."""
    rows, columns = np.flatnonzero(flags.any(axis=1)), np.flatnonzero(flags.any(axis=0))
    return _rectangle(grid, (int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1))


def forbidden_area(grid: OccupancyGrid, allowed: Flags) -> list[Rectangle]:
    """Return at most `MOST_RECTANGLES` rectangles that cover all pixels that are not `allowed`, within their bounds."""
    rows, columns = np.flatnonzero(allowed.any(axis=1)), np.flatnonzero(allowed.any(axis=0))
    low, left = int(rows[0]), int(columns[0])
    inside = ~allowed[low : int(rows[-1]) + 1, left : int(columns[-1]) + 1]
    sides, factor = few_rectangles(inside, MOST_RECTANGLES)
    corner = np.array([left, low, left, low])
    return [_rectangle(grid, tuple(one)) for one in (factor * sides + corner).tolist()]


def _rectangle(grid: OccupancyGrid, pixels: Sequence[int]) -> Rectangle:
    left, low, right, high = pixels
    x, y = grid.origin
    size = grid.resolution
    return (x + left * size, x + right * size), (y + low * size, y + high * size)
