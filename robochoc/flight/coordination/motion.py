"""The motion of drones along their paths, and the positions of all drones at any time.

Every straight piece of a path begins and ends at rest, in minimum-jerk motion: the polynomial of degree five whose
velocity and acceleration are zero at both ends (Flash and Hogan, "The coordination of arm movements", 1985). So
velocity and acceleration are continuous over a whole path, and can be the feed-forward of a controller.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robochoc.maps.routes.distances import Array, norms, squashed
from robochoc.system.lazy_dataclass import dataclass

PEAK = 15 / 8
"""The peak speed, half way, of minimum-jerk motion over a unit of length in a unit of time."""
_TOP_ACCELERATION = 10 / math.sqrt(3)
"""The peak acceleration of this motion."""


@dataclass(frozen=True)
class MotionLimits:
    """The limits of a drone's motion: `speed` in m/s, `acceleration` in m/s^2, and the minimum time from rest to rest.

    The minimum time is needed because a drone cannot tilt to one side and then to the other in much less than a second:
    it would overshoot between consecutive short pieces.
    """

    speed: float = 2.0
    acceleration: float = 2.0
    least_s: float = 0.0

    def __post_init__(self) -> None:
        if not (0 < self.speed < math.inf and 0 < self.acceleration < math.inf):
            raise ValueError(f"limits must be positive numbers, not {self.speed} m/s and {self.acceleration} m/s^2")

    def durations(self, lengths: Array) -> Array:
        """Return the shortest durations (K,) of motion over `lengths` (K,) from rest to rest, in seconds."""
        least: Array = np.maximum(PEAK * lengths / self.speed, np.sqrt(_TOP_ACCELERATION * lengths / self.acceleration))
        return np.maximum(least, self.least_s)


@dataclass(frozen=True)
class Motion:
    """The positions, velocities and accelerations of all drones at one time, in m, m/s and m/s^2, each (N, 3)."""

    position: Array
    velocity: Array
    acceleration: Array


class Route:
    """The motion of a drone along a path (K + 1, 3), from rest to rest, beginning at time 0.

    Heights in the path are divided by `downwash`; `limits` apply to the motion with the original heights.
    """

    def __init__(self, drone: int, path: Array, limits: MotionLimits, downwash: float = 1.0) -> None:
        self.drone = drone
        self.path = path
        self._durations = limits.durations(norms(squashed(np.diff(path, axis=0), 1 / downwash)))
        self._ends = np.cumsum(self._durations)
        self.duration_s = float(self._ends[-1])

    def sample(self, times: Array) -> Array:
        """Return the drone's positions (T, 3) at `times` (T,)."""
        piece = np.minimum(np.searchsorted(self._ends, times, side="right"), len(self._ends) - 1)
        durations = self._durations[piece]
        share = np.clip((times - self._ends[piece] + durations) / durations, 0, 1)
        origin = self.path[piece]
        points: Array = origin + (self.path[piece + 1] - origin) * _progress(share)[:, None]
        return points

    def pieces(self, begins_s: float) -> tuple[Array, Array, Array, Array, Array]:
        """Return the straight pieces of a route begun at `begins_s`: start and end times, durations, starts, ends."""
        ends = begins_s + self._ends
        begins = np.concatenate(([begins_s], ends[:-1]))
        return begins, ends, self._durations, self.path[:-1], self.path[1:]


@dataclass(frozen=True)
class _MotionWindow:
    """A time interval in which no drone begins or ends a piece: the pieces in motion, and the places of all others."""

    begins_s: float
    ends_s: float
    resting: Array
    drones: NDArray[np.intp]
    began: Array
    durations: Array
    origins: Array
    along: Array


class RoutePlan:
    """The positions of all drones from second 0 to `duration_s`, as planned by `plan_routes`.

    Heights in `starts` and `flights` are divided by `downwash`; the plan returns the original heights.
    """

    def __init__(self, starts: Array, flights: Sequence[tuple[Route, float]], downwash: float = 1.0) -> None:
        self._starts = squashed(starts, 1 / downwash)
        found = [(flight.drone, flight.pieces(begins)) for flight, begins in flights]
        drones = np.repeat([drone for drone, _ in found], [len(pieces[0]) for _, pieces in found]).astype(np.intp)
        joined = [np.concatenate([pieces[part] for _, pieces in found]) for part in range(5)] if found else _NONE
        order = np.argsort(joined[0], kind="stable")
        self._drones = drones[order]
        self._begins, self._ends, self._durations, self._origins, self._goals = (part[order] for part in joined)
        self._origins, self._goals = squashed(self._origins, 1 / downwash), squashed(self._goals, 1 / downwash)
        self._bounds: list[float] = np.unique(np.concatenate((self._begins, self._ends))).tolist()
        self.duration_s: float = self._bounds[-1] if self._bounds else 0.0
        self._window = self._window_at(0.0)

    def at(self, s: float) -> Motion:
        """Return the motion of all drones at second `s`, clamped to the duration of the plan."""
        s = min(max(s, 0.0), self.duration_s)
        window = self._window
        if not window.begins_s <= s < window.ends_s:
            self._window = window = self._window_at(s)
        position = window.resting.copy()
        velocity = np.zeros_like(position)
        acceleration = np.zeros_like(position)
        drones = window.drones
        if len(drones):
            share = (s - window.began) / window.durations
            rest = 1 - share
            both = share * rest
            rate = 30 * both * both / window.durations
            bend = 60 * both * (rest - share) / (window.durations * window.durations)
            position[drones] = window.origins + window.along * _progress(share)[:, None]
            velocity[drones] = window.along * rate[:, None]
            acceleration[drones] = window.along * bend[:, None]
        return Motion(position, velocity, acceleration)

    def _window_at(self, s: float) -> _MotionWindow:
        place = bisect_right(self._bounds, s)
        begins = self._bounds[place - 1] if place else -math.inf
        ends = self._bounds[place] if place < len(self._bounds) else math.inf
        resting = self._starts.copy()
        done = self._ends <= begins
        # Pieces are sorted by start time; for each drone the last one is used.
        resting[self._drones[done]] = self._goals[done]
        now = (self._begins <= begins) & ~done
        origins = self._origins[now]
        return _MotionWindow(
            begins,
            ends,
            resting,
            self._drones[now],
            self._begins[now],
            self._durations[now],
            origins,
            self._goals[now] - origins,
        )


_NONE = [np.empty(0), np.empty(0), np.empty(0), np.empty((0, 3)), np.empty((0, 3))]


def _progress(share: Array) -> Array:
    """Return the fraction of the length that is flown after a fraction `share` of the time."""
    way: Array = share * share * share * (10 + share * (6 * share - 15))
    return way
