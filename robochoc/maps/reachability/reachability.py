"""Reachability: the cells that each robot on a map can reach, and the travel times to these cells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from math import floor

from robochoc.maps.ground_map import GroundMap
from robochoc.maps.reachability.cell_size import AnyCells
from robochoc.maps.reachability.cells import Cells, Place
from robochoc.maps.reachability.ground import ground_on
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
        return ground_on(self.cells, dict(zip(self.names, self.starts, strict=True)), self.radius, self.speed)


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
