"""Moves between walls, floors and ceilings: paths in space, and an order in which drones get past each other.

Indoors there is no sky above all drones. A drone moves to its goal when the goal is free and some path to it is clear
of all resting drones. Drones whose goals block fewer paths of others move first. If no drone can move, one drone is let
through: all drones on its path move to points beside the path, preferably not on any other path, and later to their
goals. If the drone does not get through, these moves are undone.

The method is incomplete: drones may be lined up in a corridor in an order in which they cannot leave it. Then other
orders of precedence are tried, and finally `NoRouteError` is raised.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from robochoc.flight.coordination.move_order import DroneMove, MoveOrder, NoRouteError
from robochoc.flight.coordination.spacing import Spacing
from robochoc.maps.routes.distances import Array, Flags, norms, squashed
from robochoc.maps.routes.voxel_plan import Resting, VoxelPlan
from robochoc.system.lazy_dataclass import dataclass

_ORDERS = 6
"""The number of orders of precedence that are tried."""
_AWAY_M = (3.0, 12.0, math.inf)
"""The successive search radii for a point at which a drone blocks no other drone."""
_SPOTS = 2_000
"""The maximum number of candidates for this point."""


@dataclass(frozen=True)
class IndoorSpace(Spacing):
    """Finds paths between the walls of a `plan`. Heights of points, but not of the plan, are divided by `downwash`."""

    plan: VoxelPlan
    downwash: float = 1.0

    def path(self, start: Array, goal: Array, points: Array) -> Array | None:
        """Return a short path that keeps the distance from walls and from `points`; None if no path is found."""
        found = self.plan.route_among(self._unsquashed(start), self._unsquashed(goal), self._resting(points))
        if found is None:
            return None
        path = np.vstack((start, squashed(found[1:-1], self.downwash), goal))
        return path if self.is_clear(path, points) else None

    def lanes(self, start: Array, goal: Array, points: Array) -> Iterator[Array]:
        """Yield nothing: indoors, alternative paths are not searched for."""
        del start, goal, points
        yield from ()

    def spots(self, start: Array, points: Array, most: float) -> Array:
        """Return points (K, 3) that can be reached from `start` without coming too near to `points`, nearest first."""
        found = self.plan.reached(self._unsquashed(start), self._resting(points), most)
        return squashed(found, self.downwash)

    def _resting(self, points: Array) -> Resting:
        return Resting(self._unsquashed(points), self.distance, self.downwash)

    def _unsquashed(self, points: Array) -> Array:
        return squashed(points, 1 / self.downwash)


def moves_indoors(starts: Array, goals: Array, standing: Array, space: IndoorSpace, delays: Array) -> list[DroneMove]:
    """Return a sequence of moves of all drones from `starts` to `goals`. Raises `NoRouteError`."""
    refused: NoRouteError | None = None
    for number in range(_ORDERS):
        turns = np.random.default_rng(number).permutation(len(starts)) if number else np.arange(len(starts))
        try:
            return _IndoorMoves(starts, goals, standing, space, delays, turns).all_moves()
        except NoRouteError as error:
            refused = refused or error
    raise refused or NoRouteError([])


class _IndoorMoves(MoveOrder[IndoorSpace]):
    """Finds moves for one order of precedence: of equal drones, the drone with the lowest turn moves first."""

    def __init__(
        self,
        starts: Array,
        goals: Array,
        standing: Array,
        space: IndoorSpace,
        delays: Array,
        turns: npt.NDArray[np.int64],
    ) -> None:
        super().__init__(starts, goals, standing, space, delays)
        self._turns = turns
        self._standing = self.points[self.count :]
        self._routes: dict[tuple[int, bytes], Array] = {}
        self._attempts_left = 2 * self.count + 2
        self.away = {int(drone) for drone in np.flatnonzero((starts != goals).any(axis=1))}

    def all_moves(self) -> list[DroneMove]:
        """Return the moves. Raises `NoRouteError`."""
        while self.away:
            if not (self._move_one_to_goal() or self._let_one_through()):
                raise NoRouteError(sorted(self.away), indoors=True)
        return self.moves

    def move(self, drone: int, path: Array) -> None:
        """Move a drone, and record whether it is at its goal."""
        super().move(drone, path)
        if (self.rests[drone] == self.goals[drone]).all():
            self.away.discard(drone)
        else:
            self.away.add(drone)

    def _path(self, drone: int) -> Array:
        """Return the path of a drone to its goal, ignoring other drones."""
        key = drone, self.rests[drone].tobytes()
        if key not in self._routes:
            found = self.space.path(self.rests[drone], self.goals[drone], self._standing)
            if found is None:
                raise NoRouteError([drone], indoors=not len(self._standing))
            self._routes[key] = found
        return self._routes[key]

    def _is_on_path(self, drone: int, points: Array) -> Flags:
        """Return which of `points` (P, 3) are too near to the path of a drone."""
        way = self._path(drone)
        return np.asarray(self.space.near(way[:-1], way[1:], points).any(axis=0))

    def _by_precedence(self) -> list[int]:
        """Return the drones not at their goals, by delay, then by the number of others that they would block."""
        away = sorted(self.away)
        hinders = np.zeros(self.count)
        for drone in away:
            hinders += self._is_on_path(drone, self.goals)
        return sorted(away, key=lambda drone: (self.delays[drone], hinders[drone], self._turns[drone]))

    def _move_one_to_goal(self) -> bool:
        """Move one drone to its goal; return whether a drone moved."""
        ranks = [drone for drone in self._by_precedence() if self.goal_is_free(drone)]
        for drone in ranks:
            if self.space.is_clear(self._path(drone), self.others(drone)):
                self.move(drone, self._path(drone))
                return True
        return any(self._move_around(drone) for drone in ranks)

    def _move_around(self, drone: int) -> bool:
        path = self.space.path(self.rests[drone], self.goals[drone], self.others(drone))
        if path is not None:
            self.move(drone, path)
        return path is not None

    def _let_one_through(self) -> bool:
        """Move all drones off the path of one drone, then move this drone; return whether that was possible."""
        self._attempts_left -= 1
        if self._attempts_left < 0:
            return False
        for drone in self._by_precedence():
            count, points, away = len(self.moves), self.points.copy(), set(self.away)
            way = self._path(drone)
            others = [other for other in np.flatnonzero(self._is_on_path(drone, self.rests)).tolist() if other != drone]
            nearest = sorted(others, key=lambda other: (norms(way - self.rests[other]).argmin(), other))
            if (
                all(self._make_room(other, drone) for other in nearest)
                and self.goal_is_free(drone)
                and self._move_around(drone)
            ):
                return True
            del self.moves[count:]
            self.points[:] = points
            self.away = away
        return False

    def _make_room(self, other: int, drone: int) -> bool:
        """Move `other` off the path of a drone; return whether it no longer blocks the path."""
        if not self._is_on_path(drone, self.rests[other][None])[0]:
            return True
        others = self.others(other)
        for most in _AWAY_M:
            spots = self.space.spots(self.rests[other], others, most)
            spots = spots[~self._is_on_path(drone, spots)][:_SPOTS]
            if len(spots):
                path = self.space.path(self.rests[other], self._best(spots, {other, drone}), others)
                if path is not None:
                    self.move(other, path)
                    return True
        return False

    def _best(self, spots: Array, without: set[int]) -> Array:
        """Return the first of the `spots` on the fewest paths, and near the fewest goals, of other drones."""
        rest = [drone for drone in range(self.count) if drone not in without]
        hindered = (norms(spots[:, None] - self.goals[rest][None]) < self.space.distance).sum(axis=1)
        for drone in self.away - without:
            hindered = hindered + self._is_on_path(drone, spots)
        return np.asarray(spots[hindered.argmin()])
