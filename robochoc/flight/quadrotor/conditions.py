"""The conditions of a flight: the distance to keep, wind, motor failures, obstacles."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from robochoc.flight.layout import Point
from robochoc.flight.quadrotor.airframe import ROTORS

WIND_MAX_M_S = 200.0
"""No wind on the ground is faster."""
DOWNWASH_MAX = 100.0
DISTANCE_MIN_M = 0.01
"""The planner's time steps are short enough for this distance."""


@dataclass(frozen=True)
class MotorFailure:
    """One of `drone`'s motors (0 front, 1 left, 2 back, 3 right) stops `at_s` seconds after the flight's beginning."""

    drone: str
    at_s: float
    motor: int = 0


@dataclass(frozen=True)
class FlightConditions:
    """The conditions of a whole flight. The same conditions give the same flight.

    Attributes:
        distance: Metres between drones' centres that all routes keep; None: 0.5, or less where homes or goals are
            nearer to each other.
        downwash: How many distances drones keep right above each other: for routes they are ellipsoids so much taller
            than wide. Above 1 nothing else may be in the way: neither obstacles nor drones that fall.
        wind: The mean velocity of the wind, in m/s.
        gusts: The standard deviation of each component of the wind, in m/s.
        seed: The seed of the gusts.
        failures: The motors that stop.
        obstacles: Points; see `robochoc.flight.flight`.

    Raises:
        ValueError: A value is out of range.
    """

    distance: float | None = None
    downwash: float = 1.0
    wind: Point = (0.0, 0.0, 0.0)
    gusts: float = 0.0
    seed: int = 0
    failures: tuple[MotorFailure, ...] = ()
    obstacles: tuple[Point, ...] = ()

    def __post_init__(self) -> None:
        self._check_distances()
        if not 0 <= self.gusts <= WIND_MAX_M_S:
            raise ValueError(f"gusts have to be a number from 0 to {WIND_MAX_M_S:g} m/s, not {self.gusts}")
        if max(map(abs, self.wind), default=0) > WIND_MAX_M_S:
            speed = ", ".join(f"{part:g}" for part in self.wind)
            raise ValueError(f"a wind of ({speed}) is faster than {WIND_MAX_M_S:g} m/s")
        if self.seed < 0:
            raise ValueError(f"a seed has to be a number from 0 on, not {self.seed}")
        for what, point in (("wind", self.wind), *(("obstacle", place) for place in self.obstacles)):
            if not all(map(math.isfinite, point)):
                raise ValueError(f"the {what} has to be three finite numbers, x, y and z, not {point}")
        for failure in self.failures:
            if failure.motor not in range(ROTORS):
                raise ValueError(f"drone {failure.drone} has motors 0 to {ROTORS - 1}, no motor {failure.motor}")
            if not 0 <= failure.at_s < math.inf:
                raise ValueError(f"a motor can stop from second 0 on, not at {failure.at_s}")

    def _check_distances(self) -> None:
        if self.distance is not None and not DISTANCE_MIN_M <= self.distance < math.inf:
            wanted = f"a positive number of metres, {DISTANCE_MIN_M:g} at least, not {self.distance}"
            raise ValueError(f"the distance between drones has to be {wanted}")
        if not 1 <= self.downwash <= DOWNWASH_MAX:
            raise ValueError(f"downwash has to be a number from 1 to {DOWNWASH_MAX:g}, not {self.downwash}")
        if self.downwash > 1 and (self.failures or self.obstacles):
            raise ValueError("with downwash neither motors can fail nor obstacles be in the way")

    def check(self, names: Collection[str]) -> None:
        """Raise `ValueError` if a drone of `failures` is not among `names`."""
        for failure in self.failures:
            if failure.drone not in names:
                raise ValueError(f"no drone is called {failure.drone!r}; there are: {', '.join(names)}")
