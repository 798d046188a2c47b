"""The map below a team, `map.json`, from the cells of a map of a building."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import atan2

import msgspec

from robochoc.maps.ground_map import MAX_BLOCKED, GroundMap, Volume, WallPixels, WallVoxels
from robochoc.maps.occupancy.packed import packed
from robochoc.maps.reachability.cell_size import AnyCells
from robochoc.maps.reachability.cells import Cells, Cubes, Place


def ground_on(cells: AnyCells, starts: Mapping[str, Place], radius: Fraction, speed: Fraction) -> GroundMap:
    """Return the map for `map.json`, with the places of the robots by name, and the robots' radius and speed.

    Raises:
        ValueError: Too many cells of a three-dimensional map are blocked.
    """
    standing = {name: _numbered_from_1(cells, cells.containing(start)) for name, start in starts.items()}
    first = cells.first
    ground = GroundMap(
        cells.columns,
        cells.rows,
        {name: (at[0], at[1]) for name, at in standing.items()},
        first=(first[0], first[1]),
        scale=float(cells.side),
        places={name: (float(start[0]), float(start[1])) for name, start in starts.items()},
    )
    if isinstance(cells, Cubes):
        levels = {name: at[2] for name, at in standing.items()}
        heights = {name: float(start[2]) for name, start in starts.items()}
        walls = _walls_in_space(cells, float(radius), float(speed))
        return msgspec.structs.replace(ground, volume=_volume(cells, levels, heights, walls))
    return msgspec.structs.replace(ground, walls=_walls(cells, float(radius), float(speed)))


def _volume(cells: Cubes, starts: dict[str, int], heights: dict[str, float], walls: WallVoxels) -> Volume:
    if len(cells.blocked) > MAX_BLOCKED:
        raise ValueError(f"{len(cells.blocked):,} cells are blocked, more than {MAX_BLOCKED:,}; use larger cells")
    blocked = (_numbered_from_1(cells, cells.coordinates(cell)) for cell in cells.blocked)
    cubes = tuple((at[0], at[1], at[2]) for at in blocked)
    return Volume(cells.counts[2], cells.first[2], starts, cubes, cells.sides, walls, heights)


def _walls(cells: Cells, radius: float, speed: float) -> WallPixels:
    grid = cells.grid
    rows, columns = grid.free.shape
    return WallPixels(
        columns,
        rows,
        float(grid.resolution),
        (float(grid.origin[0]), float(grid.origin[1])),
        radius,
        speed,
        packed(grid.free),
        packed(grid.occupied),
        atan2(grid.rotation.sine, grid.rotation.cosine),
    )


def _walls_in_space(cells: Cubes, radius: float, speed: float) -> WallVoxels:
    grid = cells.grid
    levels, rows, columns = grid.free.shape
    x, y, z = map(float, grid.origin)
    sizes = (columns, rows, levels, float(grid.resolution))
    return WallVoxels(*sizes, (x, y, z), radius, speed, packed(grid.free), packed(grid.occupied))


def _numbered_from_1(cells: AnyCells, coordinates: tuple[int, ...]) -> tuple[int, ...]:
    """Return the coordinates of a cell as columns, rows and levels of a `GroundMap`, which are numbered from 1."""
    return tuple(one - first + 1 for one, first in zip(coordinates, cells.first, strict=True))
