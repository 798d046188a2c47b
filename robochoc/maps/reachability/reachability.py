"""Reachability: the cells that each robot on a map can reach, and the travel times to these cells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from math import atan2, floor

import msgspec

from robochoc.maps.ground_map import MAX_BLOCKED, GroundMap, Volume, WallPixels, WallVoxels
from robochoc.maps.occupancy.packed import packed
from robochoc.maps.reachability.cell_size import AnyCells
from robochoc.maps.reachability.cells import Cells, Cubes, Place
from robochoc.maps.reachability.path_lengths import UNREACHED, lengths_from
from robochoc.system.lazy_dataclass import dataclass

PLACES = 1
"""The decimal places of travel times in seconds."""
_HALF = Fraction(1, 2)


@dataclass(frozen=True, eq=False)
class Reachability:
    """Robots on a map, and the cells that they can reach.

    Attributes:
        cells: The cells of the map.
        starts: The place of each robot.
        unit: The travel time for a length of 1 on the pixels, in seconds.
        radius: The radius of a robot.
        speed: The speed of a robot, in m/s.
        longest: The longest path of a robot, as a length on the pixels. None: unlimited.
        seconds: The travel time of each robot to each cell that it can reach, in units of 10**-`PLACES` seconds.
    """

    cells: AnyCells
    starts: tuple[Place, ...]
    unit: Fraction
    radius: Fraction
    speed: Fraction
    longest: int | None
    seconds: tuple[Mapping[int, int], ...] = ()

    @property
    def names(self) -> list[str]:
        """The names of the robots."""
        return [f"Robot{number}" for number in range(1, len(self.starts) + 1)]

    @property
    def reached(self) -> list[int]:
        """The cells that at least one of the robots can reach."""
        return sorted({cell for one in self.seconds for cell in one})

    def nearest(self, place: Place, among: Iterable[int]) -> int:
        """Return the cell whose centre is nearest to a place; of equally near cells, that with the lowest number."""

        def distance(cell: int) -> tuple[Fraction, int]:
            return squared(self.cells.centre(cell), place), cell

        return min(among, key=distance)

    def seconds_from(self, pixel: tuple[int, ...]) -> dict[int, int]:
        """Return the travel times from a passable pixel, or voxel, to all free cells that can be reached from there."""
        cells = self.cells
        joined = cells.space.joined if isinstance(cells, Cells) else ()
        lengths = lengths_from(pixel, cells.passable, self.longest, joined)
        found = {}
        for cell in self.cells.free:
            end = self.cells.pixel(self.cells.centre(cell))
            length = UNREACHED if end is None else int(lengths[end])
            if length != UNREACHED:
                found[cell] = floor(length * self.unit * 10**PLACES + _HALF)
        return found

    def ground(self) -> GroundMap:
        """Return the map for `map.json`, with the places of the robots.

        Raises:
            ValueError: Too many cells of a three-dimensional map are blocked.
        """
        cells = self.cells
        standing = {
            name: self._numbered_from_1(cells.containing(start))
            for name, start in zip(self.names, self.starts, strict=True)
        }
        first = cells.first
        ground = GroundMap(
            cells.columns,
            cells.rows,
            {name: (at[0], at[1]) for name, at in standing.items()},
            first=(first[0], first[1]),
            scale=float(cells.side),
        )
        places = {name: (float(start[0]), float(start[1])) for name, start in zip(self.names, self.starts, strict=True)}
        ground = msgspec.structs.replace(ground, places=places)
        if isinstance(cells, Cubes):
            levels = {name: at[2] for name, at in standing.items()}
            return msgspec.structs.replace(ground, volume=self._volume(cells, levels))
        return msgspec.structs.replace(ground, walls=self._walls(cells))

    def _volume(self, cells: Cubes, starts: dict[str, int]) -> Volume:
        if len(cells.blocked) > MAX_BLOCKED:
            raise ValueError(f"{len(cells.blocked):,} cells are blocked, more than {MAX_BLOCKED:,}; use larger cells")
        blocked = (self._numbered_from_1(cells.coordinates(cell)) for cell in cells.blocked)
        cubes = tuple((at[0], at[1], at[2]) for at in blocked)
        heights = {name: float(start[2]) for name, start in zip(self.names, self.starts, strict=True)}
        walls = self._walls_in_space(cells)
        return Volume(cells.counts[2], cells.first[2], starts, cubes, cells.sides, walls, heights)

    def _walls(self, cells: Cells) -> WallPixels:
        grid = cells.grid
        rows, columns = grid.free.shape
        return WallPixels(
            columns,
            rows,
            float(grid.resolution),
            (float(grid.origin[0]), float(grid.origin[1])),
            float(self.radius),
            float(self.speed),
            packed(grid.free),
            packed(grid.occupied),
            atan2(grid.rotation.sine, grid.rotation.cosine),
        )

    def _walls_in_space(self, cells: Cubes) -> WallVoxels:
        grid = cells.grid
        levels, rows, columns = grid.free.shape
        x, y, z = map(float, grid.origin)
        free, occupied = packed(grid.free), packed(grid.occupied)
        sizes = (columns, rows, levels, float(grid.resolution))
        return WallVoxels(*sizes, (x, y, z), float(self.radius), float(self.speed), free, occupied)

    def _numbered_from_1(self, coordinates: tuple[int, ...]) -> tuple[int, ...]:
        """Return the coordinates of a cell as columns, rows and levels of a `GroundMap`, which are numbered from 1."""
        return tuple(one - first + 1 for one, first in zip(coordinates, self.cells.first, strict=True))


def squared(one: Place, other: Place) -> Fraction:
    """Return the square of the distance between two places."""
    return sum(((a - b) ** 2 for a, b in zip(one, other, strict=True)), Fraction(0))


def off_map(name: str, cells: AnyCells) -> str:
    """Return the error text for `name`, which is outside the map, with the extent of the map."""
    low, high = zip(*cells.ends, strict=True)
    return f"{name} is not on the map, which lies between {point_text(low)} and {point_text(high)}, in metres"


def start_pixel(cells: AnyCells, number: int, place: Place) -> tuple[int, ...]:
    """Return the pixel, or voxel, at the place of robot `number`.

    Raises:
        ValueError: The place is outside the map, or the robot does not fit there.
    """
    pixel = cells.pixel(place)
    robot = f"robot {number} at {point_text(place)}"
    if pixel is None:
        raise ValueError(off_map(robot, cells))
    if not (cells.fits(place) if isinstance(cells, Cells) else cells.passable[pixel]):
        raise ValueError(f"{robot} does not fit there: an obstacle, or unknown space, is nearer than its radius")
    return pixel


def point_text(place: Sequence[Fraction]) -> str:
    """Return a place as text: `1.5,2`."""
    return ",".join(f"{float(part):g}" for part in place)
