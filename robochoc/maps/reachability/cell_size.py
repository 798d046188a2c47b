"""Divides a map into cells for robots with a radius. The side of cells is given, or minimal for a maximum number."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import floor
from typing import TypeAlias

import numpy as np

from robochoc.maps.map_file import Map
from robochoc.maps.occupancy.grid import Flags, OccupancyGrid
from robochoc.maps.reachability.cells import Cells, Cubes
from robochoc.maps.reachability.free_space import free_space

MAX_RADIUS = 100
"""The maximum radius of a robot, in pixels."""
MAX_SIDE = 1000
"""The maximum number of columns, rows, and levels of cells."""

AnyCells: TypeAlias = Cells | Cubes


def cells_of(grid: Map, radius: Fraction, most: int, side: Fraction | None = None) -> AnyCells:
    """Return the cells of a map for robots of a radius, with a maximum number of free cells.

    Args:
        grid: The map.
        radius: The robots' radius in metres.
        most: The maximum number of free cells.
        side: The side length of a cell. None: the smallest multiple of a pixel's side with at most `most` free cells.

    Raises:
        ValueError: There is no free cell, or there are too many.
    """
    sized = _cell_factory(grid, radius)
    if side is not None:
        return _check_cells(sized(side), most)
    step, more = 1, 0
    while True:
        cells = sized(step * grid.resolution)
        if max(cells.counts) <= MAX_SIDE:
            if len(cells.free) <= most:
                break
            more = len(cells.free)
        step += 1
    if more and not cells.free:
        raise ValueError(
            f"no cell of {float(cells.side):g} m is free, but {more:,} smaller cells are: allow more cells"
        )
    return _check_cells(cells, most)


def _cell_factory(grid: Map, radius: Fraction) -> Callable[[Fraction], AnyCells]:
    """Return a function from the side of a cell to the cells of a map. Raises `ValueError` if a robot fits nowhere."""
    nowhere = f"is free for a robot of the radius {float(radius):g} m; use a smaller radius"
    if isinstance(grid, OccupancyGrid):
        space = free_space(grid.free, in_pixels(radius, grid.resolution))
        if not space.points.any():
            raise ValueError(f"no pixel {nowhere}")
        return lambda side: Cells(grid, side, space)
    fits = passable(grid.free, grid.resolution, radius)
    if not fits.any():
        raise ValueError(f"no voxel {nowhere}")
    return lambda side: Cubes(grid, side, fits)


def _check_cells(cells: AnyCells, most: int) -> AnyCells:
    side = f"{float(cells.side):g} m"
    if max(cells.counts) > MAX_SIDE:
        counts = ", ".join(
            f"{count} {what}" for count, what in zip(cells.counts, ("columns", "rows", "levels"), strict=False)
        )
        raise ValueError(
            f"with cells of {side} the map has {' and '.join(counts.rsplit(', ', 1))}; at most {MAX_SIDE} are allowed"
        )
    if len(cells.free) > most:
        raise ValueError(
            f"{len(cells.free):,} cells of {side} are free, more than {most}: use larger cells, or allow more of them"
        )
    if not cells.free:
        raise ValueError(f"no cell of {side} is free: use smaller cells, or a smaller radius")
    return cells


def in_pixels(radius: Fraction, resolution: Fraction) -> Fraction:
    """Return a radius in pixels. Raises `ValueError` if it exceeds `MAX_RADIUS`."""
    if radius > MAX_RADIUS * resolution:
        raise ValueError(
            f"the radius {float(radius):g} m is more than {MAX_RADIUS} pixels of this map: use a smaller radius"
        )
    return radius / resolution


def passable(free: Flags, resolution: Fraction, radius: Fraction) -> Flags:
    """Return the pixels at which the centre of a robot can be, because all pixels within its radius are free.

    Obstacles are inflated, as by costmap_2d with the inscribed radius. Distances are between centres of pixels. The
    outside of the map is not free. Squared distances are added up axis by axis, up to the radius.

    Args:
        free: Which pixels are free, in an array with two or three dimensions.
        resolution: The side length of a pixel, in metres.
        radius: The radius in metres.

    Raises:
        ValueError: The radius is more than `MAX_RADIUS` pixels.
    """
    limit = floor(in_pixels(radius, resolution) ** 2)
    beyond = limit + 1
    squares = np.where(free, beyond, 0).astype(np.int32)
    for axis in range(free.ndim):
        lines = np.moveaxis(squares, axis, 0)
        before = lines.copy()
        for step in range(1, len(lines) + 1):
            if step * step > limit:
                break
            np.minimum(lines[step:], before[:-step] + step * step, out=lines[step:])
            np.minimum(lines[:-step], before[step:] + step * step, out=lines[:-step])
            for edge in (lines[step - 1], lines[len(lines) - step]):
                np.minimum(edge, step * step, out=edge)
    return squares > limit
