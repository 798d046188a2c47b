"""Wind: its mean, and gusts around it, reproducible from their seed.

Gusts are first-order Gauss-Markov processes, as the longitudinal ones of the Dryden model are (MIL-F-8785C, Section
3.7.1.2). Ours: they are so in all three directions, with one correlation time, and each drone has its own. Real air is
more alike over a metre or two; independent gusts are the harder case for the distances between drones.
"""

from __future__ import annotations

import math

import numpy as np

from robochoc.flight.layout import Point
from robochoc.flight.quadrotor.airframe import Array

_CORRELATION_S = 1.5


class Wind:
    """The velocity of the air around each of `number` drones: `mean` and gusts of standard deviation `gusts`, m/s."""

    def __init__(self, mean: Point, gusts: float, seed: int, number: int, dt: float) -> None:
        self._mean = np.array(mean, dtype=np.float64)[:, None]
        self._keeps = math.exp(-dt / _CORRELATION_S)
        self._gusts = gusts
        self._chance = np.random.default_rng(seed)
        self._now = gusts * self._chance.standard_normal((3, number)) if gusts else np.zeros((3, 1))

    def air(self) -> Array:
        """Return the air's velocity in the next step: (3, N), or (3, 1) without gusts."""
        if not self._gusts:
            return self._mean
        drawn = self._chance.standard_normal(self._now.shape)
        self._now = self._keeps * self._now + self._gusts * math.sqrt(1 - self._keeps**2) * drawn
        return np.asarray(self._mean + self._now)
