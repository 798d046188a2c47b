"""Patrols on a map: the next visits of robots to points of interest.

Patrols are measured by the idleness of points, the time since a point's last visit: Machado, Ramalho, Zucker and
Drogoul, "Multi-agent patrolling: an empirical analysis of alternative architectures", MABS 2002; Portugal and Rocha,
"Multi-robot patrolling algorithms: examining performance and scalability", Advanced Robotics 27 (2013). Here robots
plan their next visits, one in each round:

- each robot visits a point in each round, and no point is visited twice;
- the cost is the sum of the travel times of all robots and the idleness of points that are not visited;
- two robots nearer to each other than `apart` after a round have a cost: the time to drive the missing distance.

Points of interest are given, or drawn: the first at random, and each other point as far as possible from the points
before it (Gonzalez, "Clustering to minimize the maximum intercluster distance", TCS 38, 1985).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations, pairwise, product
from math import floor, isqrt
from random import Random

from robochoc.formats import PREDEFINED
from robochoc.generators.draws import check_bounds, limited, random_integer, seeded
from robochoc.generators.maps.map_team import (
    MapChoice,
    check_dimensions,
    cost_constraint,
    exact,
    label_of,
    places_in,
    reachability_of,
    waypoints_of,
)
from robochoc.maps.ground_map import GroundMap
from robochoc.maps.reachability.cells import Place
from robochoc.maps.reachability.reachability import PLACES, Reachability, squared
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Domain, Relation, Semantics, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import INFINITE, ProblemKind, Team

MAX_POINTS = 100
MAX_ROUNDS = 4
MAX_PLANS = 100_000
"""The maximum number of plans per robot: the number of points to the power of the number of rounds."""
MAX_IDLE = 1_000_000
_MM = 1000
"""Distances are rounded down to millimetres."""
_HALF = Fraction(1, 2)

Legs = Mapping[int, Mapping[int, int]]
"""The time from each point to each other point that can be reached from it."""


def patrol(
    choice: MapChoice,
    seed: int = 0,
    *,
    points: int = 6,
    visit: str = "",
    idle: int = 120,
    rounds: int = 1,
    apart: float = 2.0,
) -> tuple[Team, GroundMap]:
    """Return the problem of planning a patrol's next visits, and the map in the form for flights.

    `Robot3` owns `V3`, the cell of the point that it visits; with several rounds `V3.1`, `V3.2` and so on, of which the
    first determines its waypoint. Costs are in seconds.

    Args:
        choice: The map and the robots. The travel time of each leg is at most `within`.
        seed: The same seed gives the same problem on every machine.
        points: The number of points that are drawn.
        visit: The points, `X,Y X,Y` or `X,Y,Z X,Y,Z`, in metres; each is moved to the nearest cell that a robot can
            reach. Empty: points are drawn.
        idle: The maximum idleness of a point, in seconds; idleness is uniformly random from 0 to this value.
        rounds: The number of visits that each robot plans.
        apart: The desired minimum distance between robots, in metres.

    Raises:
        InvalidInputError: A file is not a valid map.
        ValueError: A number is out of bounds, or a robot cannot reach any point.
    """
    chance = seeded(seed)
    given = places_in(visit, "visit")
    count = len(given) or points
    check_bounds({"points": (count, 1, MAX_POINTS), "rounds": (rounds, 1, MAX_ROUNDS), "idle": (idle, 0, MAX_IDLE)})
    metres = exact("apart", apart, 0, 1000)
    reachability = reachability_of(choice, chance)
    check_dimensions(given, reachability.cells, "visit")
    agents = len(reachability.starts)
    if agents * rounds > count:
        raise ValueError(f"{agents} robots make {agents * rounds} visits, more than {count} points; use more points")
    if count**rounds > MAX_PLANS:
        raise ValueError(
            f"{count} points in {rounds} rounds give more than {MAX_PLANS:,} plans; use fewer points or rounds"
        )
    if count > len(reachability.reached):
        raise ValueError(
            f"robots can reach {len(reachability.reached)} cells, fewer than {count} points; use smaller cells"
        )
    chosen = _nearest(reachability, given) if given else drawn_points(reachability, count, chance)
    idleness = {point: random_integer(chance, 0, idle) * 10**PLACES for point in chosen}
    legs = _legs(reachability, chosen) if rounds > 1 else {}
    plans = [_Plan(reachability, number, chosen, rounds) for number in range(1, agents + 1)]
    constraints = [
        *(one for plan in plans for one in plan.private(reachability, idleness, legs)),
        *_between(plans, _crowding(reachability, chosen, metres, choice.speed)),
    ]
    # The cost of a visit includes the largest idleness minus the idleness of the visited point.
    unvisited = sum(idleness.values()) - agents * rounds * max(idleness.values())
    team = assemble(
        f"patrol-{label_of(choice.map)}-{agents}-{count}-{rounds}-{seed}",
        {name: plan.variables for name, plan in zip(reachability.names, plans, strict=True)},
        limited(constraints),
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(places=PLACES, constant=unvisited),
        extras=waypoints_of(reachability, ".1" if rounds > 1 else ""),
    )
    return team, reachability.ground()


def drawn_points(reachability: Reachability, count: int, chance: Random) -> list[int]:
    """Return points of interest spread over the cells that robots can reach."""
    cells = reachability.reached
    found = [cells[random_integer(chance, 0, len(cells) - 1)]]
    away = dict.fromkeys(cells, MAX_IDLE**2)
    while len(found) < count:
        last = reachability.cells.coordinates(found[-1])
        for cell in cells:
            here = reachability.cells.coordinates(cell)
            away[cell] = min(away[cell], sum((one - other) ** 2 for one, other in zip(last, here, strict=True)))
        found.append(max(cells, key=lambda cell: (away[cell], -cell)))
    return sorted(found)


class _Plan:
    """The visits of a robot: a variable for each round, whose values are the points that the robot can reach."""

    def __init__(self, reachability: Reachability, number: int, points: Sequence[int], rounds: int) -> None:
        self.number = number
        self.first = [point for point in points if point in reachability.seconds[number - 1]]
        if not self.first:
            raise ValueError(f"robot {number} cannot reach any point; give other points, or allow more time")
        self._points = points
        self.names = [f"V{number}"] if rounds == 1 else [f"V{number}.{turn}" for turn in range(1, rounds + 1)]

    @property
    def variables(self) -> list[Variable]:
        """The robot's variables, one per round."""
        return [
            Variable(name, Domain(f"Points{name.removeprefix('V')}", tuple(range(one, one + 1) for one in values)))
            for name, values in zip(self.names, self.values, strict=True)
        ]

    @property
    def values(self) -> list[Sequence[int]]:
        """The points that can be visited in each round."""
        return [self.first, *[self._points] * (len(self.names) - 1)]

    def private(self, reachability: Reachability, idleness: Mapping[int, int], legs: Legs) -> Iterator[Constraint]:
        """Yield the costs of the robot's visits: travel times, and the largest idleness minus the point's idleness."""
        longest = max(idleness.values())
        seconds = reachability.seconds[self.number - 1]
        for name, values in zip(self.names, self.values, strict=True):
            way = seconds if name == self.names[0] else dict.fromkeys(values, 0)
            yield cost_constraint("visit", name, {point: way[point] + longest - idleness[point] for point in values})
        for scope in pairwise(self.names):
            rows = {(one, other): time for one in legs for other, time in legs[one].items() if one != other}
            relation = Relation(
                f"leg{scope[0].removeprefix('V')}",
                2,
                Semantics.SOFT,
                tuple(rows),
                tuple(rows.values()),
                default_cost=INFINITE,
            )
            yield Constraint("leg", relation, scope, scope)
        for one, other in combinations(self.names, 2):
            yield Constraint("different", PREDEFINED["ne"], (one, other), (one, other))


def _between(plans: Sequence[_Plan], crowding: Mapping[tuple[int, int], int]) -> Iterator[Constraint]:
    """Yield the constraints that no two robots visit the same point, and the costs of robots near to each other."""
    for one, other in combinations(plans, 2):
        for scope, (values, others) in zip(
            product(one.names, other.names), product(one.values, other.values), strict=True
        ):
            if not set(values).isdisjoint(others):
                yield Constraint("different", PREDEFINED["ne"], scope, scope)
        for turn, scope in enumerate(zip(one.names, other.names, strict=True)):
            pairs = product(one.values[turn], other.values[turn])
            rows = {pair: crowding[pair] for pair in pairs if crowding.get(pair)}
            if rows:
                name = "-".join(name.removeprefix("V") for name in scope)
                relation = Relation(f"near{name}", 2, Semantics.SOFT, tuple(rows), tuple(rows.values()))
                yield Constraint("near", relation, scope, scope)


def _nearest(reachability: Reachability, places: Sequence[Place]) -> list[int]:
    """Return distinct cells for the given points."""
    left, found = set(reachability.reached), []
    for place in places:
        found.append(reachability.nearest(place, left))
        left.remove(found[-1])
    return sorted(found)


def _legs(reachability: Reachability, points: Sequence[int]) -> dict[int, dict[int, int]]:
    found = {}
    for point in points:
        pixel = reachability.cells.pixel(reachability.cells.centre(point))
        times = reachability.seconds_from(pixel) if pixel else {}
        found[point] = {other: times[other] for other in points if other in times}
    return found


def _crowding(
    reachability: Reachability, points: Sequence[int], apart: Fraction, speed: float
) -> dict[tuple[int, int], int]:
    """Return, for pairs of points nearer than `apart`, the time to drive the missing distance."""
    found = {}
    for one, other in combinations(points, 2):
        square = squared(reachability.cells.centre(one), reachability.cells.centre(other))
        if square < apart**2:
            missing = apart - Fraction(isqrt(floor(square * _MM**2)), _MM)
            exactly: Fraction = missing / Fraction(str(speed)) * 10**PLACES
            found[one, other] = found[other, one] = floor(exactly + _HALF)
    return found
