"""The timetable of drones' moves, in which any two drones keep a given distance at all times.

`moves.py` returns a sequence of moves that are safe one after the other. Here the moves are scheduled in this order,
each as early as possible, without changes of moves scheduled before. A move begins at the first time at which its drone
keeps the distance from all others permanently: before the move, during it, and at rest after it. Such a time always
exists: after all scheduled moves, the other drones rest at places that are not too near to the path. This is
prioritized planning (Erdmann and Lozano-Perez, "On multiple moving objects", 1987) on fixed paths; without the order
from `moves.py` it would be incomplete.

Moves begin at discrete time steps. Within a step, motion differs from uniform straight motion by at most
acceleration * step^2 / 8. This deviation is added to the distance; apart from it, the closest approach is exact. Paths
that keep the distance from each other, or from a resting drone, are not compared in time, and need only the distance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from robochoc.flight.coordination.indoors import IndoorSpace, moves_indoors
from robochoc.flight.coordination.motion import MotionLimits, Route, RoutePlan
from robochoc.flight.coordination.move_order import DroneMove
from robochoc.flight.coordination.moves import moves_between
from robochoc.flight.coordination.paths import OutdoorSpace
from robochoc.flight.coordination.spacing import check_spacing
from robochoc.maps.routes.distances import Array, Flags, closest_approach, norms, squashed
from robochoc.maps.routes.voxel_plan import VoxelPlan
from robochoc.maps.routes.wall_plan import WallPlan
from robochoc.system.lazy_dataclass import dataclass

Steps = NDArray[np.int64]

_STEP_S = 0.05
_BULGE = 0.01
"""The largest deviation of two drones from uniform motion in a step, in distances. It limits the length of a step."""
_CHUNK = 8
"""The number of steps of a move that are compared together, using the box around them."""
_PORTION = 4096
_PATIENCE_S = 1.0
"""A drone that would wait longer tries other lanes, and uses a lane that makes it arrive earlier by this time."""
_LANES = 4
"""The number of other lanes that a drone tries."""
_FOREVER = 2**62


def plan_routes(  # noqa: PLR0913 - a problem of planning, in its own words
    starts: Array,
    goals: Array,
    *,
    distance: float,
    standing: Array | None = None,
    delays: Array | None = None,
    limits: MotionLimits | None = None,
    ground: float = 0.0,
    rises: bool = False,
    downwash: float = 1.0,
    floor_plan: WallPlan | None = None,
) -> RoutePlan:
    """Return routes of N drones from `starts` to `goals` on which all drones keep `distance` from each other.

    With a `downwash` above 1, drones are ellipsoids, taller than wide by this factor. The plan is computed for spheres,
    with heights divided by this factor.

    The result is deterministic. Lengths are in metres.

    Args:
        starts: (N, 3).
        goals: (N, 3). A drone whose start is its goal stays there, unless `moves.py` finds a solution only if it moves.
        distance: The distance between drones' centres.
        standing: Points (M, 3) from which drones also keep the distance.
        delays: (N,): the earliest start time of each drone, in seconds.
        limits: The maximum speed and acceleration of the drones.
        ground: The lowest height of drones, except for starts and goals.
        rises: True if drones take off and land vertically where possible.
        downwash: The vertical distance, as a multiple of `distance`; at least 1.
        floor_plan: Walls that no drone flies over; or walls in three dimensions, with floors and ceilings.

    Raises:
        TooCloseError: Two starts, two goals, or a start or goal and a standing point, are nearer than `distance`.
        NoRouteError: Standing points enclose a start or a goal, or drones cannot pass each other between walls.
        ValueError: An argument is invalid.
    """
    starts, goals = _points(starts, "starts"), _points(goals, "goals")
    standing = np.empty((0, 3)) if standing is None else _points(standing, "standing")
    delays = np.zeros(len(starts)) if delays is None else np.asarray(delays, dtype=float)
    if not (0 < distance < math.inf and math.isfinite(ground) and np.isfinite(delays).all()):
        raise ValueError(f"distance {distance}, ground {ground} and all delays must be finite, distance also positive")
    if not 1 <= downwash < math.inf:
        raise ValueError(f"downwash is {downwash}; it must be a finite number of at least 1")
    starts, goals, standing = (squashed(points, downwash) for points in (starts, goals, standing))
    ground /= downwash
    _check_counts(starts, goals, delays)
    check_spacing(starts, standing, distance, "start")
    check_spacing(goals, standing, distance, "goal")
    space: IndoorSpace | OutdoorSpace
    if isinstance(floor_plan, VoxelPlan):
        space = IndoorSpace(distance, floor_plan, downwash)
        moves = moves_indoors(starts, goals, standing, space, delays)
    else:
        heights = np.concatenate((starts[:, 2], goals[:, 2], standing[:, 2], [ground]))
        space = OutdoorSpace(distance, ground, float(heights.max()) + 2 * distance, rises, floor_plan)
        moves = moves_between(starts, goals, standing, space, delays)
    table = _Timetable(starts, space, limits or MotionLimits(), delays, downwash)
    for move in moves:
        table.add(move)
    return table.plan()


def _check_counts(starts: Array, goals: Array, delays: Array) -> None:
    """Raise `ValueError` unless there are as many goals and delays as starts."""
    if len(goals) != len(starts) or delays.shape != (len(starts),):
        raise ValueError(
            f"starts, goals and delays must have equal lengths, not {len(starts)}, {len(goals)} and {delays.shape}"
        )


def _points(rows: Array, name: str) -> Array:
    points = np.array(rows, dtype=float)
    if not points.size:
        points = points.reshape(0, 3)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():  # noqa: PLR2004 - x, y, z
        raise ValueError(f"{name} has the shape {points.shape}; it must have rows of three finite numbers")
    return points


@dataclass(frozen=True)
class _ScheduledMove:
    """A move in the timetable, with its positions at each step (S + 1, 3)."""

    flight: Route
    samples: Array
    begins: int

    @property
    def steps(self) -> int:
        return len(self.samples) - 1

    @property
    def ends(self) -> int:
        return self.begins + self.steps

    @cached_property
    def chunks(self) -> Array:
        """The positions in chunks (C, _CHUNK + 1, 3), padded with NaN. Each begins at the end of the previous chunk."""
        count = -(-self.steps // _CHUNK)
        padded = np.full((count * _CHUNK + 1, 3), np.nan)
        padded[: len(self.samples)] = self.samples
        chunks: Array = padded[_CHUNK * np.arange(count)[:, None] + np.arange(_CHUNK + 1)]
        return chunks


class _Timetable:
    """The scheduled moves, and the places of all drones between their moves."""

    def __init__(
        self, starts: Array, space: OutdoorSpace | IndoorSpace, limits: MotionLimits, delays: Array, downwash: float
    ) -> None:
        self._starts = starts
        self._downwash = downwash
        self._space = space
        self._limits = limits
        self._step = min(_STEP_S, math.sqrt(4 * _BULGE * space.distance / limits.acceleration))
        self._least_m = space.distance + limits.acceleration * self._step**2 / 4
        self._first: list[int] = np.ceil(np.maximum(delays, 0) / self._step).astype(int).tolist()
        self._entries: list[_ScheduledMove] = []
        self._drones = np.empty(0, dtype=np.int64)
        self._latest = 0
        self._corners = np.empty((2, 0, 3))
        """The lowest and the highest corners of the boxes around all paths."""
        # Drones at rest: the drone, its place, the first step at rest, and the step of departure.
        self._resting = np.arange(len(starts))
        self._places = starts.copy()
        self._from = np.zeros(len(starts), dtype=np.int64)
        self._to = np.full(len(starts), _FOREVER)
        self._last_rest = [*range(len(starts))]

    def add(self, move: DroneMove) -> None:
        """Schedule `move` at the first safe step; use another lane if the drone then arrives much earlier."""
        earliest = max(self._first[move.drone], int(self._from[self._last_rest[move.drone]]))
        entry = self._entry(move.drone, move.path, earliest)
        patience = math.ceil(_PATIENCE_S / self._step)
        if entry.begins > earliest + patience:
            for path in islice(self._space.lanes(move.path[0], move.path[-1], move.points), _LANES):
                other = self._entry(move.drone, path, earliest)
                if other.ends + patience < entry.ends:
                    entry = other
        self._schedule(entry)

    def plan(self) -> RoutePlan:
        """Return all scheduled moves, in seconds."""
        flights = [(entry.flight, entry.begins * self._step) for entry in self._entries]
        return RoutePlan(self._starts, flights, self._downwash)

    def _entry(self, drone: int, path: Array, earliest: int) -> _ScheduledMove:
        """Return the earliest safe move of `drone` along `path`."""
        flight = Route(drone, path, self._limits, self._downwash)
        steps = max(1, math.ceil(flight.duration_s / self._step))
        entry = _ScheduledMove(flight, flight.sample(self._step * np.arange(steps + 1, dtype=np.float64)), earliest)
        if earliest >= self._latest:
            return entry
        taken = np.zeros(self._latest + 1, dtype=bool)
        self._mark_rests(taken, entry)
        self._mark_goal(taken, entry)
        self._mark_moves(taken, entry)
        return replace(entry, begins=earliest + int(taken[earliest:].argmin()))

    def _schedule(self, entry: _ScheduledMove) -> None:
        drone, path = entry.flight.drone, entry.flight.path
        self._entries.append(entry)
        self._drones = np.append(self._drones, drone)
        self._latest = max(self._latest, entry.ends)
        self._corners = np.concatenate((self._corners, [[path.min(axis=0)], [path.max(axis=0)]]), axis=1)
        self._to[self._last_rest[drone]] = entry.begins
        self._last_rest[drone] = len(self._places)
        self._resting = np.append(self._resting, drone)
        self._places = np.vstack((self._places, path[-1]))
        self._from = np.append(self._from, entry.ends)
        self._to = np.append(self._to, _FOREVER)

    def _mark_rests(self, taken: Flags, entry: _ScheduledMove) -> None:
        """Mark the start times for which the move would pass or end too near to a drone at rest."""
        path, samples = entry.flight.path, entry.samples
        near = self._space.near(path[:-1], path[1:], self._places).any(axis=0) & (self._resting != entry.flight.drone)
        for rest in np.flatnonzero(near):
            begins, ends = int(self._from[rest]), int(self._to[rest])
            apart = samples - self._places[rest]
            steps = np.flatnonzero(closest_approach(apart[:-1], apart[1:]) < self._least_m)
            for run in np.split(steps, np.flatnonzero(np.diff(steps) > 1) + 1):
                if len(run):
                    taken[max(0, begins - int(run[-1])) : max(0, ends - int(run[0]))] = True
            if norms(apart[-1]) < self._space.least:
                taken[: max(0, ends - entry.steps)] = True

    def _mark_goal(self, taken: Flags, entry: _ScheduledMove) -> None:
        """Mark the start times for which the drone would be at its goal before another drone has passed the goal."""
        goal = entry.flight.path[-1:]
        for other in self._near(entry.flight.drone, goal):
            path = other.flight.path
            if self._space.near(path[:-1], path[1:], goal).any():
                apart = other.samples - goal
                near = np.flatnonzero(closest_approach(apart[:-1], apart[1:]) < self._least_m)
                if len(near):
                    taken[: max(0, other.begins + int(near[-1]) + 1 - entry.steps)] = True

    def _mark_moves(self, taken: Flags, entry: _ScheduledMove) -> None:
        """Mark the start times for which the drone would be too near to another moving drone."""
        others = self._near(entry.flight.drone, entry.flight.path)
        if not others:
            return
        mine, theirs = entry.chunks, np.concatenate([other.chunks for other in others])
        begins = np.concatenate([other.begins + _CHUNK * np.arange(len(other.chunks)) for other in others])
        apart = _box_gaps(_boxes(mine), _boxes(theirs))
        for pairs in _portions(np.argwhere(apart < self._least_m)):
            a, b = mine[pairs[:, 0]], theirs[pairs[:, 1]]
            gap = closest_approach(a[:, :-1, None] - b[:, None, :-1], a[:, 1:, None] - b[:, None, 1:])
            pair, my, their = np.nonzero(gap < self._least_m)
            steps = begins[pairs[pair, 1]] + their - pairs[pair, 0] * _CHUNK - my
            taken[steps[steps >= 0]] = True

    def _near(self, drone: int, path: Array) -> list[_ScheduledMove]:
        """Return the other drones' moves whose boxes are too near to the box of `path`."""
        box = np.array([[path.min(axis=0)], [path.max(axis=0)]])
        near = (_box_gaps(box, self._corners)[0] < self._space.least) & (self._drones != drone)
        return [self._entries[number] for number in np.flatnonzero(near)]


def _boxes(chunks: Array) -> Array:
    """Return the lowest and highest corners (2, C, 3) of the boxes around the chunks."""
    return np.array([np.fmin.reduce(chunks, axis=1), np.fmax.reduce(chunks, axis=1)])


def _box_gaps(first: Array, second: Array) -> Array:
    """Return the distances (A, B) between the boxes `first` (2, A, 3) and `second` (2, B, 3)."""
    (low, high), (lows, highs) = first[:, :, None], second[:, None]
    return norms(np.maximum(np.maximum(lows - high, low - highs), 0))


def _portions(pairs: Steps) -> Iterator[Steps]:
    """Yield the pairs in portions that fit into memory."""
    return (pairs[first : first + _PORTION] for first in range(0, len(pairs), _PORTION))
