"""Plans routes on which vehicles fly to their targets and keep the fleet's distance.

It uses the planner of the simulated flight (`robochoc.flight.coordination`), which returns moves that are safe one
after the other. Only the paths and their order are used. A plan contains no times, so vehicles may be late:
`traffic.py` uses telemetry to decide when each move may begin.

Vehicles on the ground first rise straight up, as their autopilots do. If the space above one of these vehicles is not
free, vehicles in the air fly to their targets first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from robochoc.flight.coordination.move_order import NoRouteError
from robochoc.flight.coordination.moves import moves_between
from robochoc.flight.coordination.paths import OutdoorSpace
from robochoc.flight.coordination.spacing import TooCloseError, check_spacing
from robochoc.flight.layout import Point
from robochoc.maps.routes.distances import SLACK_M, Array, norms, squashed
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.vehicles.fleet import Fleet, point_text

_ORDERS = 6
"""The maximum number of vehicle orders that are tried until all routes are within the fence."""
_ROUNDING_M = 1e-6
_SPOTS = 2_000
_RING = 8


class RouteError(RobochocError):
    """No routes keep the vehicles apart. The message names the vehicles or the obstacle."""


@dataclass(frozen=True)
class PlannedLeg:
    """The path (K + 1, 3) of a vehicle from rest to rest, in metres."""

    name: str
    path: Array


class RoutePlanner:
    """Plans routes within the fence of `fleet`.

    Args:
        fleet: The fleet.
        standing: The places of vehicles that stay, by name.
        distance_m: The distance between vehicles, which may differ from the value in the fleet file.
    """

    def __init__(self, fleet: Fleet, standing: Mapping[str, Point], distance_m: float) -> None:
        self._fleet = fleet
        self._fence = fleet.fence
        self._takeoff_m = fleet.takeoff_m
        self._downwash = fleet.downwash
        self._distance_m = distance_m
        self._standing = {name: at for name, at in standing.items() if all(map(math.isfinite, at))}

    def legs(
        self, starts: Mapping[str, Point], goals: Mapping[str, Point], climbing: Mapping[str, float]
    ) -> list[PlannedLeg]:
        """Return the legs of all vehicles from `starts` to `goals`, in an order in which each leg is safe.

        `climbing` has the take-off heights of vehicles on the ground, by name. Raises `RouteError`.
        """
        problem = ""
        for first in range(min(_ORDERS, max(len(starts), 1))):
            names = [*starts][first:] + [*starts][:first]
            for lifts_first in (True, False) if climbing else (True,):
                try:
                    found = self._legs(names, starts, goals, climbing, lifts_first=lifts_first)
                except RouteError as error:
                    problem = problem or str(error)
                    continue
                outside = next(self._outside(found), "")
                if not outside:
                    return found
                problem = problem if problem and not problem.startswith(_BY) else outside
        raise RouteError(problem)

    def check(self, goals: Mapping[str, Point]) -> None:
        """Raise `RouteError` if two goals, or a goal and a standing vehicle, are nearer than the distance."""
        names_in_order = [*goals, *self._standing]
        try:
            ends, still = self._flat([*goals.values()]), self._flat([*self._standing.values()])
            check_spacing(ends, still, self._distance_m, "goal")
        except TooCloseError as error:
            raise RouteError(self._too_close(error, names_in_order)) from None

    def descents(self, rests: Mapping[str, Point], grounds: Mapping[str, float]) -> list[PlannedLeg]:
        """Return the legs that land all vehicles at their current positions, the lowest first. Raises `RouteError`.

        A vehicle above the landing place of another vehicle lands next to that place.

        Args:
            rests: The positions of the vehicles, by name.
            grounds: The height of the ground below each vehicle, by name.
        """
        taken, goals = [*self._standing.values()], dict[str, Point]()
        rests = dict(sorted(rests.items(), key=lambda one: one[1][2]))
        for name, at in rests.items():
            free_spot = self.free_spot(at, taken)
            if free_spot is None:
                raise RouteError(f"there is no place for {name} to land")
            goals[name] = (*free_spot[:2], grounds[name])
            taken.append(free_spot)
        legs: list[PlannedLeg] = []
        now = {**rests}
        for name, at in rests.items():
            path = np.array([at, goals[name]])
            others = [other for one, other in now.items() if one != name]
            if at[:2] == goals[name][:2] and self.is_clear(path, [*others, *self._standing.values()]):
                legs.append(PlannedLeg(name, path))
                now[name] = goals[name]
        down = {name: at for name, at in now.items() if at == goals[name]}
        late = {name: at for name, at in now.items() if name not in down}
        if late:
            rest = RoutePlanner(self._fleet, self._standing | down, self._distance_m)
            legs += rest.legs(late, {name: goals[name] for name in late}, {})
        return legs

    def is_clear(self, path: Array, others: Sequence[Point]) -> bool:
        """Return whether a path keeps the distance from `others`."""
        return self._space([*map(tuple, path.tolist()), *others]).is_clear(self._flat(path), self._flat(others))

    def free_spot(self, at: Point, taken: Sequence[Point]) -> Point | None:
        """Return the point in the fence nearest to `at` that, seen from above, keeps the distance from `taken`."""
        low, high, distance_m = self._fence.low, self._fence.high, self._fleet.distance_m
        for x, y in _rings(at[0], at[1], distance_m):
            if (x, y) != at[:2] and not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
                continue
            if all(math.hypot(x - other[0], y - other[1]) >= distance_m - SLACK_M for other in taken):
                return x, y, at[2]
        return None

    def _legs(
        self,
        names: Sequence[str],
        starts: Mapping[str, Point],
        goals: Mapping[str, Point],
        climbing: Mapping[str, float],
        *,
        lifts_first: bool,
    ) -> list[PlannedLeg]:
        rests = {name: starts[name] for name in names}
        if lifts_first:
            legs = self._lifts(rests, climbing)
            return legs + self._moves(rests, goals, [*names])
        above = [name for name in names if name not in climbing]
        legs = self._moves(rests, goals, above)
        legs += self._lifts(rests, climbing)
        return legs + self._moves(rests, goals, [*names])

    def _lifts(self, rests: dict[str, Point], climbing: Mapping[str, float]) -> list[PlannedLeg]:
        """Return the legs of rising vehicles, and update the places in `rests`."""
        legs: list[PlannedLeg] = []
        left = [*climbing]
        while left:
            for name in left:
                path = np.array([rests[name], (*rests[name][:2], climbing[name])])
                others = {other: at for other, at in (rests | self._standing).items() if other != name}
                if self.is_clear(path, [*others.values()]):
                    legs.append(PlannedLeg(name, path))
                    rests[name] = (*rests[name][:2], climbing[name])
                    left.remove(name)
                    break
            else:
                nearest = min(others, key=lambda other: float(norms(path - np.array(others[other])).min()))
                raise RouteError(f"{left[-1]} cannot rise to {climbing[left[-1]]:g} m: {nearest} is too near")
        return legs

    def _moves(self, rests: dict[str, Point], goals: Mapping[str, Point], names: Sequence[str]) -> list[PlannedLeg]:
        """Return the legs of the vehicles `names` to their goals, and update the places in `rests`."""
        if not names:
            return []
        standing = {other: at for other, at in (rests | self._standing).items() if other not in names}
        names_in_order = [*names, *standing]
        begins, ends = self._flat([rests[name] for name in names]), self._flat([goals[name] for name in names])
        still = self._flat([*standing.values()])
        space = self._space([*(rests[name] for name in names), *(goals[name] for name in names), *standing.values()])
        try:
            check_spacing(begins, still, self._distance_m, "start")
            check_spacing(ends, still, self._distance_m, "goal")
            moves = moves_between(begins, ends, still, space, np.zeros(len(names)))
        except TooCloseError as error:
            raise RouteError(self._too_close(error, names_in_order)) from None
        except NoRouteError as error:
            stuck = ", ".join(names_in_order[number] for number in error.drones)
            raise RouteError(f"no route was found for {stuck}: other vehicles enclose it") from None
        for name in names:
            rests[name] = goals[name]
        return [PlannedLeg(names[move.drone], squashed(move.path, 1 / self._downwash)) for move in moves]

    def _too_close(self, error: TooCloseError, names_in_order: Sequence[str]) -> str:
        where = "are" if error.where == "start" else "would be"
        first, second = names_in_order[error.first], names_in_order[error.second]
        unit = "" if self._downwash == 1 else f", heights divided by {self._downwash:g}"
        apart = f"{first} and {second} {where} {error.distance_m:.2f} m apart{unit}"
        return f"{apart}: less than 'distance', {self._distance_m:g} m"

    def _outside(self, legs: Sequence[PlannedLeg]) -> Iterator[str]:
        """Yield an error text for each route that leaves the fence. Routes may begin, and rise, outside the fence."""
        for leg in legs:
            for x, y, z in leg.path[1:].tolist():
                rises = [x, y] == leg.path[0, :2].tolist() and z <= self._fence.high[2]
                if not rises and not self._fence.covers((x, y, z), _ROUNDING_M):
                    yield f"{_BY} {point_text((x, y, z))} for {leg.name}, outside the fence ({self._fence})"

    def _flat(self, points: Sequence[Point] | Array) -> Array:
        """Return points (N, 3) with their heights divided by the downwash."""
        rows = np.array(points, dtype=float).reshape(-1, 3)
        return squashed(rows, self._downwash)

    def _space(self, points: Sequence[Point]) -> OutdoorSpace:
        ground = self._fence.low[2] / self._downwash
        heights = [*self._flat(points)[:, 2].tolist(), ground]
        return OutdoorSpace(self._distance_m, ground, max(heights) + 2 * self._distance_m, rises=True)


_BY = "the only route found passes"


def _rings(x: float, y: float, distance_m: float) -> Iterator[tuple[float, float]]:
    """Yield points in rings around a point in the plane, half a distance apart, the nearest first."""
    yield x, y
    for number in range(_RING, _SPOTS):
        ring, step = divmod(number, _RING)
        angle = 2 * math.pi * (step + ring % 2 / 2) / _RING
        radius = ring * distance_m * 0.501
        yield x + radius * math.cos(angle), y + radius * math.sin(angle)


def spacing(points: Sequence[Point], downwash: float) -> float:
    """Return the smallest distance between two of `points`, with heights divided by `downwash`."""
    rows = squashed(np.array(points, dtype=float).reshape(-1, 3), downwash)
    apart = norms(rows[:, None] - rows[None])
    apart[np.diag_indices(len(rows))] = np.inf
    return float(apart.min(initial=math.inf))
