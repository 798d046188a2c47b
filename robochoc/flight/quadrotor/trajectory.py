"""A trajectory: routes that follow a clock which can be slowed to a stop.

All drones share one clock, so drones keep their distances at any rate of the clock. The clock stops smoothly: over
`STOP_S` its rate falls from 1 to 0 by a cubic polynomial, with a slope of at most 1.5 / `STOP_S`. At the planned 2 m/s
this requires 3.75 m/s^2 besides a quarter of the planned acceleration, well within the limits of a drone. The stopping
distance is at most that flown in `STOP_S` / 2 at this speed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robochoc.flight.coordination.motion import RoutePlan
from robochoc.flight.quadrotor.airframe import Array

_SAMPLE_S = 0.05
"""The time between samples of a trajectory, in which a drone flies 0.1 m at 2 m/s."""
_LOOK_M = 0.1


STOP_S = 0.8


class Trajectory:
    """The routes `plan` of the drones `who` (their numbers). All others keep their `setpoints` (9, N)."""

    def __init__(self, plan: RoutePlan, who: npt.NDArray[np.intp], setpoints: Array) -> None:
        self.plan = plan
        self.who = who
        self.stopping = False
        self._setpoints = setpoints
        self._s = 0.0
        self._stop_begins_s = 0.0
        self._slow = 0.0
        self._rests = False
        self._everybody = len(who) == setpoints.shape[1]

    @property
    def s(self) -> float:
        """The time on the routes' clock, in seconds."""
        return self._s

    @property
    def has_ended(self) -> bool:
        """True if setpoints no longer move: the end is reached, or the clock has stopped."""
        return self._s >= self.plan.duration_s or self._slow >= STOP_S

    def stop(self) -> None:
        """Begin to slow the clock."""
        if not self.stopping:
            self.stopping = True
            self._stop_begins_s = self._s

    def advance(self, dt: float) -> None:
        """Advance by `dt` seconds of real time."""
        if not self.stopping:
            self._s = min(self._s + dt, self.plan.duration_s)
        elif self._slow < STOP_S:
            self._slow = min(self._slow + dt, STOP_S)
            share = self._slow / STOP_S
            way = share - share**3 + share**4 / 2
            self._s = min(self._stop_begins_s + STOP_S * way, self.plan.duration_s)

    def update_setpoints(self) -> Array:
        """Update and return the present setpoints (9, N): positions, velocities and accelerations."""
        if self._rests:
            return self._setpoints
        self._rests = self.has_ended
        share = self._slow / STOP_S
        rate = 1 - share * share * (3 - 2 * share)
        motion = self.plan.at(self._s)
        if self._everybody:
            setpoints = self._setpoints
            self._fill(setpoints, motion.position, rate * motion.velocity, rate * rate * motion.acceleration)
        else:
            setpoints = np.empty((9, len(self.who)))
            self._fill(setpoints, motion.position, rate * motion.velocity, rate * rate * motion.acceleration)
        if self.stopping:
            setpoints[6:] -= motion.velocity.T * (6 * share * (1 - share) / STOP_S)
        if not self._everybody:
            self._setpoints[:, self.who] = setpoints
        return self._setpoints

    @staticmethod
    def _fill(setpoints: Array, position: Array, velocity: Array, acceleration: Array) -> None:
        setpoints[:3] = position.T
        setpoints[3:6] = velocity.T
        setpoints[6:] = acceleration.T


class ObstacleEncounter(NamedTuple):
    """A drone's trajectory that passes an obstacle nearer than `keep`, for the last time at second `until`."""

    obstacle: int
    drone: int
    until: float
    keep: float


def encounters(trajectory: Trajectory, obstacles: dict[int, Array], keep: float) -> list[ObstacleEncounter]:
    """Return all encounters with `obstacles` (by number), which the planner does not know."""
    if not obstacles:
        return []
    times = np.append(np.arange(0.0, trajectory.plan.duration_s, _SAMPLE_S), trajectory.plan.duration_s)
    places = np.stack([trajectory.plan.at(float(s)).position for s in times])
    found = []
    for number, obstacle in obstacles.items():
        near = np.square(places - obstacle).sum(2) < (keep + _LOOK_M) ** 2
        for place in np.flatnonzero(near.any(0)).tolist():
            until = float(times[np.flatnonzero(near[:, place])[-1]])
            found.append(ObstacleEncounter(number, int(trajectory.who[place]), until, keep))
    return found
