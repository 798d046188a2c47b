"""The cells of a map, and how large they are: of a given side, or as small as their number allows."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import TypeAlias

from robochoc.formats.maps import Map
from robochoc.formats.occupancy.grid import OccupancyGrid
from robochoc.generators.maps.cells import Cells
from robochoc.generators.maps.clearance import in_pixels, passable
from robochoc.generators.maps.cubes import Cubes
from robochoc.generators.maps.room import room_on

MAX_SIDE = 1000
"""The maximum number of columns, of rows, and of levels of cells."""

AnyCells: TypeAlias = Cells | Cubes
Place: TypeAlias = tuple[Fraction, ...]
"""The x and the y of a place in metres, and on three-dimensional maps its z."""


def cells_of(grid: Map, radius: Fraction, most: int, side: Fraction | None = None) -> AnyCells:
    """Return the cells of a map for robots of a radius, at most so many free ones.

    Args:
        grid: The map.
        radius: The robots' radius in metres.
        most: The maximum number of free cells.
        side: The side of a cell. None: the smallest multiple of a pixel's side that makes no more free cells than that.

    Raises:
        ValueError: if there is no free cell, or there are too many.
    """
    sized = _sized(grid, radius)
    if side is not None:
        return _checked(sized(side), most)
    step, more = 1, 0
    while True:
        cells = sized(step * grid.resolution)
        if max(cells.counts) <= MAX_SIDE:
            if len(cells.free) <= most:
                break
            more = len(cells.free)
        step += 1
    if more and not cells.free:
        raise ValueError(f"no cell of {float(cells.side):g} m is free, and {more:,} smaller ones are; allow more cells")
    return _checked(cells, most)


def _sized(grid: Map, radius: Fraction) -> Callable[[Fraction], AnyCells]:
    """Return what makes the cells of a map, by their side. Raises `ValueError` where a robot fits nowhere."""
    nowhere = f"is free for a robot of the radius {float(radius):g} m; take a smaller radius"
    if isinstance(grid, OccupancyGrid):
        room = room_on(grid.free, in_pixels(radius, grid.resolution))
        if not room.points.any():
            raise ValueError(f"no pixel {nowhere}")
        return lambda side: Cells(grid, side, room)
    fits = passable(grid.free, grid.resolution, radius)
    if not fits.any():
        raise ValueError(f"no voxel {nowhere}")
    return lambda side: Cubes(grid, side, fits)


def _checked(cells: AnyCells, most: int) -> AnyCells:
    side = f"{float(cells.side):g} m"
    if max(cells.counts) > MAX_SIDE:
        told = ", ".join(
            f"{count} {what}" for count, what in zip(cells.counts, ("columns", "rows", "levels"), strict=False)
        )
        raise ValueError(f"cells of {side} make {' and '.join(told.rsplit(', ', 1))}; {MAX_SIDE} are allowed")
    if len(cells.free) > most:
        raise ValueError(f"{len(cells.free):,} cells of {side} are free, more than {most}: take larger cells, or more")
    if not cells.free:
        raise ValueError(f"no cell of {side} is free: take smaller cells, or a smaller radius")
    return cells
