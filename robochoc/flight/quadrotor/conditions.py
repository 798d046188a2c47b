"""The conditions of a flight: the distance to keep, wind, motor failures, obstacles."""

from __future__ import annotations

import math
from collections.abc import Collection

from robochoc.flight.layout import Point
from robochoc.flight.quadrotor.airframe import ROTORS
from robochoc.system.lazy_dataclass import dataclass

WIND_MAX_M_S = 200.0
"""The largest wind speed; winds near the ground are slower."""
DOWNWASH_MAX = 100.0
DISTANCE_MIN_M = 0.01
"""The smallest distance for which the planner's time steps are short enough."""


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
        distance: The distance between drones' centres that all routes keep, in metres; None: 0.5, or less if homes or
            goals are nearer to each other.
        downwash: The vertical distance of drones, as a multiple of `distance`: for routes, drones are ellipsoids taller
            than wide by this factor. Above 1, obstacles and motor failures are not possible.
        wind: The mean wind velocity, in m/s.
        gusts: The standard deviation of each component of the wind velocity, in m/s.
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
            raise ValueError(f"gusts are {self.gusts} m/s; they must be from 0 to {WIND_MAX_M_S:g} m/s")
        if max(map(abs, self.wind), default=0) > WIND_MAX_M_S:
            speed = ", ".join(f"{part:g}" for part in self.wind)
            raise ValueError(f"the wind ({speed}) m/s is faster than the maximum of {WIND_MAX_M_S:g} m/s")
        if self.seed < 0:
            raise ValueError(f"the seed is {self.seed}; it must be at least 0")
        for what, point in (("wind", self.wind), *(("obstacle", place) for place in self.obstacles)):
            if not all(map(math.isfinite, point)):
                raise ValueError(f"the {what} is {point}; it must be three finite numbers, x, y and z")
        for failure in self.failures:
            if failure.motor not in range(ROTORS):
                raise ValueError(f"drone {failure.drone} has no motor {failure.motor}; motors are 0 to {ROTORS - 1}")
            if not 0 <= failure.at_s < math.inf:
                raise ValueError(f"the time of a motor failure is {failure.at_s} s; it must be finite, and at least 0")

    def _check_distances(self) -> None:
        if self.distance is not None and not DISTANCE_MIN_M <= self.distance < math.inf:
            raise ValueError(f"the distance is {self.distance}; it must be finite, and at least {DISTANCE_MIN_M:g} m")
        if not 1 <= self.downwash <= DOWNWASH_MAX:
            raise ValueError(f"downwash is {self.downwash}; it must be a number from 1 to {DOWNWASH_MAX:g}")
        if self.downwash > 1 and (self.failures or self.obstacles):
            raise ValueError("downwash cannot be combined with motor failures or obstacles")

    def check(self, names: Collection[str]) -> None:
        """Raise `ValueError` if a drone in `failures` is not among `names`."""
        for failure in self.failures:
            if failure.drone not in names:
                raise ValueError(f"no drone is called {failure.drone!r}; the drones are {', '.join(names)}")
