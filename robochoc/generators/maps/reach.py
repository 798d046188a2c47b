"""Which robot can get to which cells of a map, and how long that takes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from math import floor
from pathlib import Path
from random import Random

from robochoc.formats import PREDEFINED
from robochoc.formats.ground_map import MAX_BLOCKED, BlockedCell, GroundMap
from robochoc.formats.occupancy.grid import read_occupancy_grid
from robochoc.generators.draws import check_bounds, some
from robochoc.generators.maps.cells import Cells, Place, cells_of
from robochoc.generators.maps.travel import STRAIGHT, UNREACHED, lengths_from
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
"""The z of waypoints, in sides of a cell: drones fly so high above the floor."""
_POINT = re.compile(r"([+-]?\d{1,7}(?:\.\d{1,6})?),([+-]?\d{1,7}(?:\.\d{1,6})?)")
_HALF = Fraction(1, 2)


@dataclass(frozen=True, kw_only=True)
class MapChoice:
    """A map, and the robots on it. Lengths are in metres, places in the map's frame.

    Attributes:
        map: The path of the map's YAML file.
        agents: The number of robots. None: as many as `at` has places.
        at: Where the robots are: `X,Y X,Y`. Empty: drawn from the free cells, each choice as likely as any other.
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
        longest: The longest way of a robot, as a length on the pixels. None: any.
        seconds: For each robot the time to each cell that it can get to, in units of 10**-`PLACES` seconds.
    """

    cells: Cells
    starts: tuple[Place, ...]
    unit: Fraction
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
            x, y = self.cells.centre(cell)
            return (x - place[0]) ** 2 + (y - place[1]) ** 2, cell

        return min(among, key=distance)

    def seconds_from(self, pixel: tuple[int, int]) -> dict[int, int]:
        """Return the time from a passable pixel to each free cell to which a way leads."""
        lengths = lengths_from(pixel, self.cells.passable, self.longest)
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
            ValueError: Too many cells are blocked.
        """
        columns, rows = self.cells.columns, self.cells.rows
        if len(self.cells.blocked) > MAX_BLOCKED:
            raise ValueError(
                f"{len(self.cells.blocked):,} cells are blocked, more than {MAX_BLOCKED:,}; take larger cells"
            )
        blocked = (divmod(cell, columns) for cell in self.cells.blocked)
        standing = (self.cells.column_and_row(start) for start in self.starts)
        return GroundMap(
            columns,
            rows,
            {name: (column + 1, row + 1) for name, (column, row) in zip(self.names, standing, strict=True)},
            tuple(BlockedCell(column + 1, row + 1) for row, column in blocked),
            self.cells.first,
            float(self.cells.side),
        )

    def _waypoint(self, name: str, variable: str) -> Topic:
        columns = Constant(self.cells.columns)
        x, y = (
            _moved(Apply(function, (Name(variable), columns)), by)
            for function, by in zip(("mod", "div"), self.cells.first, strict=True)
        )
        return Topic(f"/{name.lower()}/waypoint", x=x, y=y, z=Constant(HEIGHT))


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
    cells = cells_of(read_occupancy_grid(Path(choice.map)), radius, most, side)
    if not places:
        if agents > len(cells.free):
            raise ValueError(f"{agents} robots do not fit on {len(cells.free)} free cells; take smaller cells")
        places = [cells.centre(cells.free[place]) for place in some(chance, len(cells.free), agents)]
    # A step of STRAIGHT is one pixel.
    unit = cells.grid.resolution / (STRAIGHT * speed)
    longest = None if within is None else floor(within / unit)
    pixels = [_standing(cells, number, place) for number, place in enumerate(places, 1)]
    reach = Reach(cells, tuple(places), unit, longest)
    return replace(reach, seconds=tuple(map(reach.seconds_from, pixels)))


def places_in(text: str, name: str) -> list[Place]:
    """Return the places in a text, `X,Y X,Y`, in metres. Raises `ValueError`."""
    found = []
    for word in text.split():
        matched = _POINT.fullmatch(word)
        if not matched:
            raise ValueError(f"{name} has {word[:50]!r}; expected places in metres, such as '1.5,2 3,-0.5'")
        found.append((Fraction(matched[1]), Fraction(matched[2])))
    return found


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


def _agents(agents: int | None, places: Sequence[Place]) -> int:
    if agents is None and not places:
        raise ValueError("agents is missing (without at)")
    if places and agents not in {None, len(places)}:
        raise ValueError(f"agents is {agents}, and at has {len(places)} places")
    found = agents or len(places)
    check_bounds({"agents": (found, 1, MAX_ROBOTS)})
    return found


def _standing(cells: Cells, number: int, place: Place) -> tuple[int, int]:
    """Return the pixel on which a robot stands."""
    pixel = cells.pixel(place)
    told = f"robot {number} at {float(place[0]):g},{float(place[1]):g}"
    if pixel is None:
        raise ValueError(f"{told} is not on the map")
    if not cells.passable[pixel]:
        raise ValueError(f"{told} stands where it does not fit: its radius, or what is not free, is in the way")
    return pixel
