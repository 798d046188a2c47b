"""Which robot can get to which cells of a map, and how long that takes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from math import atan2, floor
from pathlib import Path
from random import Random

import msgspec

from robochoc.formats import PREDEFINED
from robochoc.generators.draws import check_bounds, some
from robochoc.generators.maps.cells import Cells
from robochoc.generators.maps.cubes import Cubes
from robochoc.generators.maps.sizes import AnyCells, Place, cells_of
from robochoc.generators.maps.travel import STRAIGHT, UNREACHED, lengths_from
from robochoc.maps.ground_map import MAX_BLOCKED, GroundMap, Volume, WallPixels, WallVoxels
from robochoc.maps.map_file import read_map
from robochoc.maps.occupancy.packed import packed
from robochoc.model.assembly import Extras
from robochoc.model.constraint import Constraint, Domain, Relation, Semantics, Variable
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.problem import Topic

MAX_ROBOTS = 100
MAX_CELLS = 1000
USUAL_CELLS = 100
PLACES = 1
"""Decimal places of costs: they are seconds."""
HEIGHT = 1
"""The z of waypoints on a map of the ground, in sides of a cell: drones fly so high above the floor."""
_PART = re.compile(r"[+-]?\d{1,7}(?:\.\d{1,6})?")
_HALF = Fraction(1, 2)


@dataclass(frozen=True, kw_only=True)
class MapChoice:
    """A map, and the robots on it. Lengths are in metres, places in the map's frame.

    Attributes:
        map: The path of the map's YAML file, or of an OctoMap.
        agents: The number of robots. None: as many as `at` has places.
        at: Where the robots are: `X,Y X,Y`, on an OctoMap `X,Y,Z X,Y,Z`. Empty: drawn from the free cells,
            each choice as likely as any other.
        radius: The radius of a robot.
        speed: Metres a second.
        within: A robot gets to the cells that it reaches in so many seconds. None: in any time.
        cell: The side of a cell. None: the smallest multiple of the map's resolution with at most `cells` free cells.
        cells: The maximum number of free cells. None: `USUAL_CELLS`, or `MAX_CELLS` for cells of a given side.
    """

    map: str
    agents: int | None = None
    at: str = ""
    radius: float = 0.2
    speed: float = 0.5
    within: float | None = None
    cell: float | None = None
    cells: int | None = None


@dataclass(frozen=True, eq=False)
class Reach:
    """Robots on a map.

    Attributes:
        cells: The cells of the map.
        starts: Where each robot is.
        unit: The time of a length of 1 on the pixels, in seconds.
        radius: The radius of a robot.
        speed: Metres a second.
        longest: The longest way of a robot, as a length on the pixels. None: any.
        seconds: For each robot the time to each cell that it can get to, in units of 10**-`PLACES` seconds.
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
        """The cells that one of the robots, or several, can get to."""
        return sorted({cell for one in self.seconds for cell in one})

    def variables(self, values: Sequence[Iterable[int]]) -> dict[str, list[Variable]]:
        """Return a variable for each robot, `V1` and so on, with these cells as its values."""
        return {
            name: [Variable(f"V{number}", Domain(f"Cells{number}", tuple(range(one, one + 1) for one in sorted(own))))]
            for number, (name, own) in enumerate(zip(self.names, values, strict=True), 1)
        }

    def extras(self, suffix: str = "") -> Extras:
        """Return the waypoints of all robots: formulas over the numbers of cells, which variables `V1` have as values.

        With a suffix these are `V1` and the suffix.
        """
        return Extras(
            topics={name: (self._waypoint(name, f"V{number}{suffix}"),) for number, name in enumerate(self.names, 1)}
        )

    def nearest(self, place: Place, among: Iterable[int]) -> int:
        """Return the cell whose centre is nearest to a place; of several the one of the lowest number."""

        def distance(cell: int) -> tuple[Fraction, int]:
            return squared(self.cells.centre(cell), place), cell

        return min(among, key=distance)

    def seconds_from(self, pixel: tuple[int, ...]) -> dict[int, int]:
        """Return the time from a passable pixel, or voxel, to each free cell to which a way leads."""
        cells = self.cells
        joined = cells.room.joined if isinstance(cells, Cells) else ()
        lengths = lengths_from(pixel, cells.passable, self.longest, joined)
        found = {}
        for cell in self.cells.free:
            end = self.cells.pixel(self.cells.centre(cell))
            length = UNREACHED if end is None else int(lengths[end])
            if length != UNREACHED:
                found[cell] = floor(length * self.unit * 10**PLACES + _HALF)
        return found

    def ground(self) -> GroundMap:
        """Return the map as the flight reads it.

        Raises:
            ValueError: Too many cells of a three-dimensional map are blocked.
        """
        cells = self.cells
        # From 1 on along each axis, as maps of the ground have it.
        standing = {
            name: self._places_from_1(cells.containing(start))
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
            raise ValueError(f"{len(cells.blocked):,} cells are blocked, more than {MAX_BLOCKED:,}; take larger cells")
        blocked = (self._places_from_1(cells.coordinates(cell)) for cell in cells.blocked)
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
            atan2(grid.turn.sine, grid.turn.cosine),
        )

    def _walls_in_space(self, cells: Cubes) -> WallVoxels:
        grid = cells.grid
        levels, rows, columns = grid.free.shape
        x, y, z = map(float, grid.origin)
        free, occupied = packed(grid.free), packed(grid.occupied)
        sizes = (columns, rows, levels, float(grid.resolution))
        return WallVoxels(*sizes, (x, y, z), float(self.radius), float(self.speed), free, occupied)

    def _places_from_1(self, coordinates: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(one - first + 1 for one, first in zip(coordinates, self.cells.first, strict=True))

    def _waypoint(self, name: str, variable: str) -> Topic:
        columns, rows = Constant(self.cells.columns), Constant(self.cells.rows)
        number = Name(variable)
        parts: list[Expression] = [Apply("mod", (number, columns)), Apply("div", (number, columns))]
        if isinstance(self.cells, Cubes):
            level = Constant(self.cells.columns * self.cells.rows)
            parts[1:] = [Apply("mod", (parts[1], rows)), Apply("div", (number, level))]
        found = [_moved(part, by) for part, by in zip(parts, self.cells.first, strict=True)]
        x, y, z = found if len(found) > 2 else (*found, Constant(HEIGHT))  # noqa: PLR2004 - x and y
        return Topic(f"/{name.lower()}/waypoint", x=x, y=y, z=z)


def squared(one: Place, other: Place) -> Fraction:
    """Return the square of the distance between two places."""
    return sum(((a - b) ** 2 for a, b in zip(one, other, strict=True)), Fraction(0))


def _moved(expression: Expression, by: int) -> Expression:
    return Apply("add", (expression, Constant(by))) if by else expression


def reach_of(choice: MapChoice, chance: Random) -> Reach:
    """Return which robots get where.

    Raises:
        InvalidInputError: The files hold no map.
        ValueError: A number is out of its bounds, or a robot does not stand where it can.
    """
    places = places_in(choice.at, "at")
    agents = _agents(choice.agents, places)
    radius, speed = exact("radius", choice.radius, 0, 100), exact("speed", choice.speed, 0.001, 100)
    side = None if choice.cell is None else exact("cell", choice.cell, 0.001, 1000)
    most = choice.cells or (USUAL_CELLS if side is None else MAX_CELLS)
    check_bounds({"cells": (most, 1, MAX_CELLS)})
    within = None if choice.within is None else exact("within", choice.within, 0, 1_000_000)
    cells = cells_of(read_map(Path(choice.map)), radius, most, side)
    check_dimensions(places, cells, "at")
    if not places:
        if agents > len(cells.free):
            raise ValueError(f"{agents} robots do not fit on {len(cells.free)} free cells; take smaller cells")
        places = [cells.centre(cells.free[place]) for place in some(chance, len(cells.free), agents)]
    # A step of STRAIGHT is one pixel.
    unit = cells.grid.resolution / (STRAIGHT * speed)
    longest = None if within is None else floor(within / unit)
    pixels = [_standing(cells, number, place) for number, place in enumerate(places, 1)]
    reach = Reach(cells, tuple(places), unit, radius, speed, longest)
    return replace(reach, seconds=tuple(map(reach.seconds_from, pixels)))


def places_in(text: str, name: str) -> list[Place]:
    """Return the places in a text, `X,Y X,Y` or `X,Y,Z X,Y,Z`, in metres. Raises `ValueError`."""
    found = []
    for word in text.split():
        parts = word.split(",")
        if not (2 <= len(parts) <= 3 and all(map(_PART.fullmatch, parts))):  # noqa: PLR2004 - x, y and maybe z
            raise ValueError(f"{name} has {word[:50]!r}; expected places in metres, such as '1.5,2 3,-0.5'")
        found.append(tuple(map(Fraction, parts)))
    return found


def check_dimensions(places: Iterable[Place], cells: AnyCells, name: str) -> None:
    """Raise `ValueError` unless all places have as many coordinates as the map."""
    wanted = len(cells.first)
    for place in places:
        if len(place) != wanted:
            told = ",".join(f"{float(part):g}" for part in place)
            expected = "X,Y,Z on a three-dimensional map" if wanted > len(place) else "X,Y on a map of the ground"
            raise ValueError(f"{name} has '{told}'; expected {expected}")


def all_different(values: Sequence[Iterable[int]]) -> Iterator[Constraint]:
    """Yield that no two robots choose the same cell: a constraint for each pair that could."""
    sets = [set(own) for own in values]
    for (one, own), (other, others) in combinations(enumerate(sets, 1), 2):
        if not own.isdisjoint(others):
            scope = (f"V{one}", f"V{other}")
            yield Constraint("different", PREDEFINED["ne"], scope, scope)


def charged(name: str, variable: str, costs: Mapping[int, int]) -> Constraint:
    """Return what the values of a variable cost its robot."""
    values = sorted(costs)
    relation = Relation(
        f"{name}{variable.removeprefix('V')}",
        1,
        Semantics.SOFT,
        tuple((value,) for value in values),
        tuple(costs[value] for value in values),
    )
    return Constraint(name, relation, (variable,), (variable,))


def exact(name: str, number: float, least: float, most: float) -> Fraction:
    """Return the decimal that a number is written as. Raises `ValueError` where it is out of bounds."""
    check_bounds({name: (number, least, most)})
    return Fraction(str(number))


def label_of(path: str) -> str:
    """Return the name of a map's file as a part of a team's name."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", Path(path).stem)[:50].strip("-") or "map"


def off_map(what: str, cells: AnyCells) -> str:
    """Return the words that `what` is not on the map, and where the map is."""
    low, high = zip(*cells.ends, strict=True)
    return f"{what} is not on the map, which lies between {_point(low)} and {_point(high)}, in metres"


def _point(place: Sequence[Fraction]) -> str:
    return ",".join(f"{float(part):g}" for part in place)


def _agents(agents: int | None, places: Sequence[Place]) -> int:
    if agents is None and not places:
        raise ValueError("agents is missing, as at names no places")
    if places and agents not in {None, len(places)}:
        raise ValueError(f"agents is {agents}, and at has {len(places)} places")
    found = agents or len(places)
    check_bounds({"agents": (found, 1, MAX_ROBOTS)})
    return found


def _standing(cells: AnyCells, number: int, place: Place) -> tuple[int, ...]:
    """Return the pixel on which a robot stands, or the voxel in which it is."""
    pixel = cells.pixel(place)
    told = f"robot {number} at {_point(place)}"
    if pixel is None:
        raise ValueError(off_map(told, cells))
    if not (cells.fits(place) if isinstance(cells, Cells) else cells.passable[pixel]):
        raise ValueError(f"{told} stands where it does not fit: its radius, or what is not free, is in the way")
    return pixel
