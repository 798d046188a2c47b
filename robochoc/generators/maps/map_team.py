"""Teams of robots on a map: their variables, waypoints and shared constraints."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import combinations
from math import floor
from pathlib import Path
from random import Random

from robochoc.formats import PREDEFINED
from robochoc.generators.draws import check_bounds, sample
from robochoc.maps.map_file import read_map
from robochoc.maps.reachability.cell_size import AnyCells, cells_of
from robochoc.maps.reachability.cells import Cubes, Place
from robochoc.maps.reachability.path_lengths import STRAIGHT
from robochoc.maps.reachability.reachability import Reachability, point_text, start_pixel
from robochoc.model.assembly import Extras
from robochoc.model.constraint import Constraint, Domain, Relation, Semantics, Variable
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.problem import Topic
from robochoc.system.lazy_dataclass import dataclass

MAX_ROBOTS = 100
MAX_CELLS = 1000
USUAL_CELLS = 100
HEIGHT = 1
"""The z of waypoints on a two-dimensional map, in cells: drones fly at this height above the floor."""
_PART = re.compile(r"[+-]?\d{1,7}(?:\.\d{1,6})?")


@dataclass(frozen=True, kw_only=True)
class MapChoice:
    """A map, and the robots on it. Lengths are in metres, places in the map's frame.

    Attributes:
        map: The path of the map's YAML file, or of an OctoMap.
        agents: The number of robots. None: the number of places in `at`.
        at: The places of the robots: `X,Y X,Y`, or `X,Y,Z X,Y,Z` on an OctoMap. Empty: drawn uniformly from the free
            cells.
        radius: The radius of a robot.
        speed: The speed of a robot, in m/s.
        within: The longest travel time of a robot to a cell, in seconds. None: unlimited.
        cell: The side length of a cell. None: the smallest multiple of the map's resolution with at most `cells` free
            cells.
        cells: The maximum number of free cells. None: `USUAL_CELLS`, or `MAX_CELLS` if `cell` is given.
    """

    map: str
    agents: int | None = None
    at: str = ""
    radius: float = 0.2
    speed: float = 0.5
    within: float | None = None
    cell: float | None = None
    cells: int | None = None


def variables_of(reachability: Reachability, values: Sequence[Iterable[int]]) -> dict[str, list[Variable]]:
    """Return a variable for each robot, `V1` and so on, with the robot's cells in `values`."""
    return {
        name: [Variable(f"V{number}", Domain(f"Cells{number}", tuple(range(one, one + 1) for one in sorted(own))))]
        for number, (name, own) in enumerate(zip(reachability.names, values, strict=True), 1)
    }


def waypoints_of(reachability: Reachability, suffix: str = "") -> Extras:
    """Return the waypoints of all robots, as formulas over the variables `V1` and so on, whose values are cell numbers.

    With a suffix, the variables are named `V1` followed by the suffix.
    """
    cells = reachability.cells
    return Extras(
        topics={
            name: (_waypoint(cells, name, f"V{number}{suffix}"),) for number, name in enumerate(reachability.names, 1)
        }
    )


def _waypoint(cells: AnyCells, name: str, variable: str) -> Topic:
    columns, rows = Constant(cells.columns), Constant(cells.rows)
    number = Name(variable)
    parts: list[Expression] = [Apply("mod", (number, columns)), Apply("div", (number, columns))]
    if isinstance(cells, Cubes):
        level = Constant(cells.columns * cells.rows)
        parts[1:] = [Apply("mod", (parts[1], rows)), Apply("div", (number, level))]
    found = [_moved(part, by) for part, by in zip(parts, cells.first, strict=True)]
    x, y, z = found if len(found) > 2 else (*found, Constant(HEIGHT))  # noqa: PLR2004 - x and y
    return Topic(f"/{name.lower()}/waypoint", x=x, y=y, z=z)


def _moved(expression: Expression, by: int) -> Expression:
    return Apply("add", (expression, Constant(by))) if by else expression


def reachability_of(choice: MapChoice, chance: Random) -> Reachability:
    """Return the cells that the robots in `choice` can reach.

    Raises:
        InvalidInputError: A file is not a valid map.
        ValueError: A number is out of bounds, or a robot does not fit at its place.
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
            raise ValueError(f"{agents} robots do not fit on {len(cells.free)} free cells; use smaller cells")
        places = [cells.centre(cells.free[place]) for place in sample(chance, len(cells.free), agents)]
    # A step of STRAIGHT is one pixel.
    unit = cells.grid.resolution / (STRAIGHT * speed)
    longest = None if within is None else floor(within / unit)
    pixels = [start_pixel(cells, number, place) for number, place in enumerate(places, 1)]
    reachability = Reachability(cells, tuple(places), unit, radius, speed, longest)
    return replace(reachability, seconds=tuple(map(reachability.seconds_from, pixels)))


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
    dimensions = len(cells.first)
    for place in places:
        if len(place) != dimensions:
            expected = "X,Y,Z on a three-dimensional map" if dimensions > len(place) else "X,Y on a map of the ground"
            raise ValueError(f"{name} has '{point_text(place)}'; expected {expected}")


def all_different(values: Sequence[Iterable[int]]) -> Iterator[Constraint]:
    """Yield a constraint `different` for each pair of robots that could choose the same cell."""
    sets = [set(own) for own in values]
    for (one, own), (other, others) in combinations(enumerate(sets, 1), 2):
        if not own.isdisjoint(others):
            scope = (f"V{one}", f"V{other}")
            yield Constraint("different", PREDEFINED["ne"], scope, scope)


def cost_constraint(name: str, variable: str, costs: Mapping[int, int]) -> Constraint:
    """Return the soft constraint with the cost of each value of a variable."""
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
    """Return the exact value of a number's decimal notation. Raises `ValueError` if the number is out of bounds."""
    check_bounds({name: (number, least, most)})
    return Fraction(str(number))


def label_of(path: str) -> str:
    """Return the name of a map file, cleaned for use in the name of a team."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", Path(path).stem)[:50].strip("-") or "map"


def _agents(agents: int | None, places: Sequence[Place]) -> int:
    if agents is None and not places:
        raise ValueError("agents is missing: give the number of robots, or their places with at")
    if places and agents not in {None, len(places)}:
        raise ValueError(f"agents is {agents}, but at has {len(places)} places: omit agents, or make them equal")
    found = agents or len(places)
    check_bounds({"agents": (found, 1, MAX_ROBOTS)})
    return found
