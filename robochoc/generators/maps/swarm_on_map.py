"""Swarms on a map: drones that choose real positions in the free space, outside of walls.

The costs are those of `generators/swarm.py`, but displacements are near those between homes, so that the formation fits
on the map. Instead of a formation, drones can place sensors: random targets cost their squared distances from the
nearer of two drones. This is the locational optimisation of Cortes, Martinez, Karatas and Bullo, "Coverage control for
mobile sensing networks", IEEE Transactions on Robotics and Automation 20 (2004), limited to pairs of drones.

Hard constraints forbid each pixel in which a drone does not fit everywhere, or which it cannot reach.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from random import Random

import numpy as np

from robochoc.generators.draws import check_bounds, random_integer, sample, seeded
from robochoc.generators.maps.map_team import MAX_ROBOTS, exact, label_of, places_in
from robochoc.generators.swarm import MOST_SIDE, PLACES, POINTS, Drones, real_domain
from robochoc.maps.ground_map import GroundMap
from robochoc.maps.map_file import read_map
from robochoc.maps.occupancy.grid import Flags, OccupancyGrid
from robochoc.maps.reachability.cell_size import in_pixels
from robochoc.maps.reachability.cells import Cells, Place
from robochoc.maps.reachability.free_area import Rectangle, bounds_of, forbidden_area, free_pixels, reached_pixels
from robochoc.maps.reachability.free_space import free_space
from robochoc.maps.reachability.ground import ground_on
from robochoc.maps.reachability.reachability import squared, start_pixel
from robochoc.model.problem import Domain, Team

_APART_M = 1
"""The minimum distance between random starts, and between homes."""
_DEVIATION = 100
"""The largest deviation of a displacement from that between homes, for x and y, in hundredths of a metre."""
_TRIES = 10_000
_UNIT = 10**PLACES


def swarm_on_map(
    map: str,  # noqa: A002 - the name of the option
    *,
    agents: int,
    at: str = "",
    radius: float = 0.2,
    speed: float = 0.5,
    points: int = POINTS,
    targets: int = 0,
    seed: int = 0,
) -> tuple[Team, GroundMap]:
    """Return a swarm of drones on a map of the ground, and the map in the form for flights.

    Args:
        map: The path of the map's YAML file.
        agents: The number of drones.
        at: The starts of the drones in metres, `X,Y X,Y`. Empty: random, 1 m apart.
        radius: The radius of a drone in metres, which is also its minimum distance from walls.
        speed: The speed of drones in m/s.
        points: The number of points of the first grid along the longer side of the map.
        targets: The number of targets of a sensor placement. 0: a formation.
        seed: The same seed gives the same problem on every machine.

    Raises:
        InvalidInputError: The file is not a valid map.
        ValueError: A number is out of bounds, the map is rotated or has three dimensions, or drones do not fit.
    """
    check_bounds(
        {"agents": (agents, 1, MAX_ROBOTS), "points": (points, 2, MOST_SIDE), "targets": (targets, 0, MOST_SIDE)}
    )
    if targets and agents == 1:
        raise ValueError("targets is not 0; sensor placement requires at least 2 robots")
    size, fast = exact("radius", radius, 0, 100), exact("speed", speed, 0.001, 100)
    starts = places_in(at, "at")
    if starts and len(starts) != agents:
        raise ValueError(f"at has {len(starts)} places, but agents is {agents}: make them equal")
    if any(len(place) != 2 for place in starts):  # noqa: PLR2004 - x and y
        raise ValueError("at has a place with a z; expected X,Y on a map of the ground")
    cells = _cells_on(map, size)
    free = free_pixels(cells, size)
    if not free.any():
        raise ValueError(f"no pixel is free for a robot of the radius {radius:g} m; use a smaller radius")
    chance = seeded(seed)
    starts = starts or _random_starts(cells.grid, free, agents, chance)
    drones, homes = Drones(), list[tuple[int, int]]()
    areas = list(_areas(cells, free, starts))
    step = max(area.length for area in areas) / (points - 1)
    for drone, area in enumerate(areas, 1):
        homes.append(area.random_place(chance, homes))
        drones.add(drone, area.domains(drone, step), homes[-1], area.forbidden)
        if drone > 1 and not targets:
            apart = (own - above for own, above in zip(homes[-1], homes[drone // 2 - 1], strict=True))
            drones.keep(drone, [part + random_integer(chance, -_DEVIATION, _DEVIATION) for part in apart])
        if drone > 1:
            drones.separate(drone)
    for target in range(1, targets + 1):
        drone = random_integer(chance, 2, agents)
        place = areas[drone - 1].random_place(chance)
        distances = {number: math.dist(place, home) for number, home in enumerate(homes, 1)}
        drones.cover(target, place, max(2, min(distances, key=distances.__getitem__)))
    named = {f"Robot{number}": start for number, start in enumerate(starts, 1)}
    name = f"swarm-{label_of(map)}-{agents}" + f"-{points}" * (points != POINTS)
    name += f"-targets{targets}" * bool(targets) + f"-{seed}"
    return drones.team(name), ground_on(cells, named, size, fast)


class _Area:
    """The area in which a drone can choose a position.

    Attributes:
        spans: The intervals of x and y, in hundredths of a metre.
        forbidden: The rectangles that it must not enter, in metres.
    """

    def __init__(self, grid: OccupancyGrid, allowed: Flags) -> None:
        self.spans: list[tuple[int, int]] = [
            (math.ceil(low * _UNIT), math.floor(high * _UNIT)) for low, high in bounds_of(grid, allowed)
        ]
        self.forbidden = forbidden_area(grid, allowed)

    @property
    def length(self) -> int:
        """The longer side, in hundredths of a metre."""
        return max(high - low for low, high in self.spans)

    def domains(self, drone: int, step: float) -> tuple[Domain, Domain]:
        """Return the domains of a drone's x and y, with grids whose step is at most `step` hundredths of a metre."""
        x, y = (
            real_domain(f"{axis}{drone}", low, high, math.ceil((high - low) / step) + 1)
            for axis, (low, high) in zip("XY", self.spans, strict=True)
        )
        return x, y

    def random_place(self, chance: Random, others: Sequence[tuple[int, int]] = ()) -> tuple[int, int]:
        """Return a random place, at least `_APART_M` from `others`, in hundredths of a metre.

        Raises:
            ValueError: No place is found.
        """
        for _ in range(_TRIES):
            x, y = (random_integer(chance, low, high) for low, high in self.spans)
            is_near = any((x - a) ** 2 + (y - b) ** 2 < (_APART_M * _UNIT) ** 2 for a, b in others)
            if not is_near and not any(_is_inside((x, y), rectangle) for rectangle in self.forbidden):
                return x, y
        raise ValueError(f"the map has no place for {len(others) + 1} homes {_APART_M} m apart; use fewer robots")


def _is_inside(place: Sequence[int], rectangle: Rectangle) -> bool:
    return all(low < Fraction(part, _UNIT) < high for part, (low, high) in zip(place, rectangle, strict=True))


def _cells_on(path: str, radius: Fraction) -> Cells:
    """Return the cells of 1 m on a map, so that positions are in metres."""
    grid = read_map(Path(path))
    if not isinstance(grid, OccupancyGrid) or not grid.rotation.is_zero:
        what = "is rotated" if isinstance(grid, OccupancyGrid) else "has three dimensions"
        raise ValueError(f"map {what}; real positions require a map of the ground with pixels parallel to its axes")
    cells = Cells(grid, Fraction(1), free_space(grid.free, in_pixels(radius, grid.resolution)))
    if max(cells.counts) > MOST_SIDE:
        raise ValueError(f"the map is longer than {MOST_SIDE} m")
    return cells


def _random_starts(grid: OccupancyGrid, free: Flags, agents: int, chance: Random) -> list[Place]:
    """Return the centres of random free pixels that are at least `_APART_M` from each other."""
    pixels = np.argwhere(free).tolist()
    found: list[Place] = []
    while pixels and len(found) < agents:
        row, column = pixels.pop(sample(chance, len(pixels), 1)[0])
        half = Fraction(1, 2)
        place = tuple(at + (part + half) * grid.resolution for at, part in zip(grid.origin, (column, row), strict=True))
        if all(squared(place, other) >= _APART_M**2 for other in found):
            found.append(place)
    if len(found) < agents:
        raise ValueError(f"only {len(found)} of {agents} robots fit on the map {_APART_M} m apart; use fewer robots")
    return found


def _areas(cells: Cells, free: Flags, starts: Sequence[Place]) -> Iterator[_Area]:
    """Yield the area of each drone: the free pixels that it can reach from its start."""
    known: list[tuple[Flags, _Area]] = []
    for number, start in enumerate(starts, 1):
        pixel = start_pixel(cells, number, start)
        pixel = pixel[0], pixel[1]
        area = next((area for reached, area in known if reached[pixel]), None)
        if area is None:
            reached = reached_pixels(cells, pixel)
            if not (free & reached).any():
                raise ValueError(f"robot {number} cannot reach any free position; choose another start")
            area = _Area(cells.grid, free & reached)
            known.append((reached, area))
        yield area
