"""A plan on a clock that can be slowed to a stop: where everybody is wanted.

One clock is common to all drones, so the distances of the plan hold however it runs. It stops smoothly: with the share
of `STOP_S` that is over it slows from 1 to 0 by a cubic, whose slope is at most 1.5 / `STOP_S`. At the planned 2 m/s
this takes 3.75 m/s^2 beside a quarter of the planned acceleration, well within what a drone can do, and no more way
than that of `STOP_S` / 2 at that speed.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robochoc.flight.quadrotor.airframe import Array
from robochoc.flight.routes.motion import RoutePlan

STOP_S = 0.8


class Trajectory:
    """The `plan` of the drones `who` (their numbers); all others stay where `reference` (9, N) has them."""

    def __init__(self, plan: RoutePlan, who: npt.NDArray[np.intp], reference: Array) -> None:
        self.plan = plan
        self.who = who
        self.stopping = False
        self._reference = reference
        self._s = 0.0
        self._begun = 0.0
        self._slow = 0.0
        self._rests = False
        self._everybody = len(who) == reference.shape[1]

    @property
    def s(self) -> float:
        """How far the plan has come: its own seconds."""
        return self._s

    @property
    def over(self) -> bool:
        """Whether nobody is wanted to move any more: at the end, or where the clock has stopped."""
        return self._s >= self.plan.duration_s or self._slow >= STOP_S

    def stop(self) -> None:
        """Begin to slow the clock."""
        if not self.stopping:
            self.stopping = True
            self._begun = self._s

    def advance(self, dt: float) -> None:
        """So much later by everybody else's clock."""
        if not self.stopping:
            self._s = min(self._s + dt, self.plan.duration_s)
        elif self._slow < STOP_S:
            self._slow = min(self._slow + dt, STOP_S)
            share = self._slow / STOP_S
            way = share - share**3 + share**4 / 2
            self._s = min(self._begun + STOP_S * way, self.plan.duration_s)

    def refer(self) -> Array:
        """(9, N): the places, velocities and accelerations that are wanted now."""
        if self._rests:
            return self._reference
        self._rests = self.over
        share = self._slow / STOP_S
        rate = 1 - share * share * (3 - 2 * share)
        motion = self.plan.at(self._s)
        if self._everybody:
            wanted = self._reference
            self._fill(wanted, motion.position, rate * motion.velocity, rate * rate * motion.acceleration)
        else:
            wanted = np.empty((9, len(self.who)))
            self._fill(wanted, motion.position, rate * motion.velocity, rate * rate * motion.acceleration)
        if self.stopping:
            wanted[6:] -= motion.velocity.T * (6 * share * (1 - share) / STOP_S)
        if not self._everybody:
            self._reference[:, self.who] = wanted
        return self._reference

    @staticmethod
    def _fill(wanted: Array, position: Array, velocity: Array, acceleration: Array) -> None:
        wanted[:3] = position.T
        wanted[3:6] = velocity.T
        wanted[6:] = acceleration.T
