"""The order in which drones move, one at a time: each path is clear of all drones that rest during the move.

A drone moves to its goal when the goal is free and there is a path to it (`paths.py`). If all remaining drones block
each other, for example because they swap places, one of them makes room, near its place if possible, else in the sky.

This always ends, since a drone makes room near its place once and in the sky once, and then moves to its goal. If no
drone can make room, the search starts again with `_MovesBySky`: every drone, even one that could stay, moves up to its
own column in the sky, and then down to its goal. Drones move up as soon as they can, so that fewer drones block others;
if this order gets stuck, every other order does, too. They move down in the reverse of an order in which they could
leave their goals.

So a solution is found if all drones could move up from their starts, and from their goals, one after the other. Without
standing points this is always possible: the path up from the topmost drone leads away from all others, and drones cross
at a height without resting drones, a distance above all places and a distance below the waiting drones. With standing
points the method fails only if a drone is enclosed by these points, or by drones with too little space between them.
`NoRouteError` is then raised.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import count, product, takewhile

import numpy as np

from robochoc.flight.coordination.move_order import DroneMove, MoveOrder, NoRouteError
from robochoc.flight.coordination.paths import OutdoorSpace
from robochoc.maps.routes.distances import Array, Flags, norms

_RINGS = 20
"""The largest radius, in distances, of the search for a waiting place in the sky between walls."""
_PathFinder = Callable[[Array, Array, Array], Array | None]


def moves_between(starts: Array, goals: Array, standing: Array, space: OutdoorSpace, delays: Array) -> list[DroneMove]:
    """Return a sequence of moves of all drones from `starts` to `goals`. Raises `NoRouteError`.

    `space.sky` is at least two distances above all starts and goals. Drones with shorter delays, or that block fewer
    others, move first.
    """
    found = _DirectMoves(starts, goals, standing, space, delays)
    if not found.solve():
        found.moves = _MovesBySky(starts, goals, standing, space, delays).all_moves()
    return found.moves


class _MovesUnderSky(MoveOrder[OutdoorSpace]):
    """Moves in a space with a sky above all drones, in which they can wait."""

    def __init__(self, starts: Array, goals: Array, standing: Array, space: OutdoorSpace, delays: Array) -> None:
        super().__init__(starts, goals, standing, space, delays)
        self.waiting: set[int] = set()
        """The drones in the sky."""

    def move(self, drone: int, path: Array) -> None:
        """Move a drone, and record that it no longer waits in the sky."""
        super().move(drone, path)
        self.waiting.discard(drone)

    def to_goal(self, drone: int, ways: Iterable[_PathFinder], *, low: bool = True) -> bool:
        """Move a drone to its goal, by the first of `ways` with a path; along the ground only if `low`.

        Return whether the drone moved.
        """
        if not self.goal_is_free(drone):
            return False
        others = self.others(drone)
        for way in ways:
            path = way(self.rests[drone], self.goals[drone], others)
            if path is not None and (low or not self.space.slides(path[:-1], path[1:]).any()):
                self.move(drone, path)
                return True
        return False

    def to_sky(self, drone: int) -> bool:
        """Move a drone up to a waiting place, a distance above the height for crossing; return whether it moved."""
        others = self.others(drone)
        up = self.space.path_up(self.rests[drone], others)
        if up is None:
            return False
        spot = self._spot(self.rests[drone], up[-1])
        if spot is None:
            return False
        if (up[-1, :2] == spot[:2]).all():
            path = np.vstack((up[:-1], spot))
        else:
            path = np.vstack((up, [*spot[:2], self.space.sky], spot))
        if not self.space.is_clear(path, others):
            return False
        self.move(drone, path)
        self.waiting.add(drone)
        return True

    def _spot(self, start: Array, up: Array) -> Array | None:
        """Return the nearest point in the sky at the distance, seen from above, from all waiting drones.

        The point can be reached from `up`. None if walls prevent this for all points.
        """
        taken = self.rests[[*self.waiting], :2]
        offsets = _spiral(self.space.distance, math.inf if self.space.floor_plan is None else _RINGS)
        spots = (start[:2] + offset for offset in offsets)
        apart = (spot for spot in spots if (norms(taken - spot) >= self.space.distance).all())
        free = next((spot for spot in apart if not self.space.is_walled(up[None], spot[None])[0]), None)
        return None if free is None else np.array([*free, self.space.sky + self.space.distance])


class _DirectMoves(_MovesUnderSky):
    """Drones move to their goals as soon as they can; drones that block others make room."""

    def __init__(self, starts: Array, goals: Array, standing: Array, space: OutdoorSpace, delays: Array) -> None:
        super().__init__(starts, goals, standing, space, delays)
        self.away = {int(drone) for drone in np.flatnonzero((starts != goals).any(axis=1))}
        self._moved_aside: set[int] = set()
        self._next_search = [0] * self.count
        self._top = space.sky - space.distance
        active = [*self.away]
        self._blocked = np.zeros((self.count, len(self.points)), dtype=bool)
        """Element [i, j]: the straight path of drone i is blocked by drone j, which is at rest."""
        self._blocked_by_goal = np.zeros((self.count, self.count), dtype=bool)
        """Element [i, j]: the straight path of drone i would be blocked by drone j at its goal."""
        self._lengths = norms(goals - starts)
        self._blocked[active] = space.near(starts[active], goals[active], self.points)
        self._blocked_by_goal[active] = space.near(starts[active], goals[active], goals)
        self._blocked[active, active] = self._blocked_by_goal[active, active] = False
        self._blocked[self._barred(starts, goals), :] = True

    def solve(self) -> bool:
        """Move all drones to their goals; return whether that was possible."""
        while self.away:
            if not (
                self._move_straight()
                or self._move_by_lane()
                or self._move_by_detour(self._unhindered())
                or self._move_aside()
                or self._move_by_detour(self._by_precedence())
                or self._move_up()
                or self._move_by_detour(self._by_precedence(), again=True)
            ):
                return False
        return True

    def move(self, drone: int, path: Array) -> None:
        """Move a drone, and update which paths are blocked."""
        super().move(drone, path)
        here, goal = self.rests[drone], self.goals[drone]
        self._blocked[:, drone] = False
        others = [other for other in self.away if other != drone]
        if others:
            barred = self._barred(self.rests[others], self.goals[others])
            near = self.space.near(self.rests[others], self.goals[others], here[None])[:, 0]
            self._blocked[others, drone] = near | barred
        if (here == goal).all():
            self.away.discard(drone)
        else:
            for matrix, points in ((self._blocked, self.points), (self._blocked_by_goal, self.goals)):
                matrix[drone] = self.space.near(here[None], goal[None], points)[0]
                matrix[drone, drone] = False
            if self._barred(here[None], goal[None])[0]:
                self._blocked[drone] = True
            self._lengths[drone] = norms(goal - here)

    def _barred(self, starts: Array, goals: Array) -> Flags:
        """Return which straight paths (K,) are forbidden because they lead along the ground or through walls."""
        return self.space.slides(starts, goals) | self.space.is_walled(starts, goals)

    def _by_precedence(self) -> list[int]:
        """Return the drones not at their goals, by delay, number of drones that they would block, and distance."""
        away = sorted(self.away)
        hinders = self._blocked_by_goal[away].sum(axis=0)
        return sorted(away, key=lambda drone: (self.delays[drone], hinders[drone], -self._lengths[drone], drone))

    def _move_straight(self) -> bool:
        before = len(self.moves)
        for drone in self._by_precedence():
            if not self._blocked[drone].any():
                self.move(drone, np.array([self.rests[drone], self.goals[drone]]))
        return len(self.moves) > before

    def _move_by_lane(self) -> bool:
        return any(self.to_goal(drone, (self.space.by_lane,)) for drone in self._by_precedence())

    def _unhindered(self) -> list[int]:
        """Return the drones whose straight paths are blocked only by drones that are at their goals."""
        return [drone for drone in self._by_precedence() if not self._blocked[drone, [*self.away]].any()]

    def _move_by_detour(self, drones: Iterable[int], *, again: bool = False) -> bool:
        """Move one of `drones` by a detour, and return whether one moved.

        Since a search takes long, a drone without a path searches again only after others have moved. With `again`, if
        nothing else is possible, all drones search again, and may move along the ground.
        """
        for drone in drones:
            if (again or len(self.moves) >= self._next_search[drone]) and self.goal_is_free(drone):
                if self.to_goal(drone, (self.space.around, self.space.over_all), low=again):
                    return True
                self._next_search[drone] = len(self.moves) + 1 + len(self.away)
        return False

    def _move_aside(self) -> bool:
        """Move a drone that blocks many others a short distance away."""
        away = sorted(self.away)
        blocks = self._blocked[away].sum(axis=0)
        ranks = sorted(self.away - self._moved_aside, key=lambda drone: (-blocks[drone], -self.rests[drone][2], drone))
        for drone in ranks:
            self._moved_aside.add(drone)
            path = self._path_aside(drone)
            if path is not None:
                self.move(drone, path)
                return True
        return False

    def _path_aside(self, drone: int) -> Array | None:
        """Return a path to the nearest free point at which the drone blocks the fewest others."""
        here, others = self.rests[drone], self.others(drone)
        spots = here + _AROUND * self.space.distance
        low = min(self.space.ground + self.space.distance, float(here[2]))
        spots = spots[(spots[:, 2] >= low) & (spots[:, 2] <= self._top)]
        spots = spots[~self._barred(np.broadcast_to(here, spots.shape), spots)]
        rest = [other for other in self.away if other != drone]
        taken = np.vstack((others, self.goals[rest]))
        # Offsets are longer by a thousandth, so that rounding errors do not exclude points between two places.
        free = (norms(spots[:, None] - taken[None]) >= self.space.distance).all(axis=1)
        spots = spots[free]
        spots = spots[~self.space.near(np.broadcast_to(here, spots.shape), spots, others).any(axis=1)]
        if not len(spots):
            return None
        blocked = self.space.near(self.rests[rest], self.goals[rest], spots).sum(axis=0)
        return np.array([here, spots[blocked.argmin()]])

    def _move_up(self) -> bool:
        ranks = sorted(self.away - self.waiting, key=lambda drone: (-self.rests[drone][2], drone))
        been = {move.drone for move in self.moves if move.path[-1][2] > self.space.sky}
        return any(self.to_sky(drone) for drone in ranks if drone not in been)


class _MovesBySky(_MovesUnderSky):
    """All drones move up, then down to their goals in the reverse of an order in which they could leave the goals."""

    def all_moves(self) -> list[DroneMove]:
        """Return the moves. Raises `NoRouteError`."""
        standing = self.points[self.count :]
        left = _MovesBySky(self.goals, self.goals, standing, self.space, self.delays)
        left.empty()
        self.empty()
        for move in reversed(left.moves):
            if not self.to_goal(move.drone, (self.space.by_lane, self.space.over_all)):
                raise NoRouteError([move.drone])
        return self.moves

    def empty(self) -> None:
        """Move all drones up; of those that can move, the topmost first."""
        drones = sorted(range(self.count), key=lambda drone: -self.rests[drone][2])
        while drones:
            for drone in drones:
                if self.to_sky(drone):
                    drones.remove(drone)
                    break
            else:
                raise NoRouteError(sorted(drones))


def _spiral(distance: float, rings: float) -> Iterator[Array]:
    """Yield offsets in the plane, ring by ring, from inside to outside."""
    yield np.zeros(2)
    for ring in takewhile(lambda ring: ring <= rings, count(1)):
        for step in range(6 * ring):
            angle = math.pi * step / (3 * ring)
            yield np.array([math.cos(angle), math.sin(angle)]) * (ring * distance)


def _around() -> Array:
    """Return offsets for making room, in distances, nearest first: up, to eight sides (level, up, down), or down."""
    # A little more than the distance, so that rounding errors do not exclude points on the line between two places.
    radii = (1.001, 1.5, 2.0, 3.0)
    sides = [(math.cos(step * math.pi / 4), math.sin(step * math.pi / 4)) for step in range(8)]
    level = [np.array((x, y, 0.0)) for x, y in sides]
    leans = [np.array((x, y, z)) / math.sqrt(2) for z, (x, y) in product((1, -1), sides)]
    directions = [np.array((0.0, 0.0, 1.0)), *level, *leans, np.array((0.0, 0.0, -1.0))]
    return np.array([radius * direction for radius in radii for direction in directions])


_AROUND = _around()
