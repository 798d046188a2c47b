"""What was flown: a pure record, for pictures, files and reports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robochoc.flight.layout import Point

Array = npt.NDArray[np.float64]

SAMPLE_RATE_HZ = 30


@dataclass(frozen=True)
class ClosestApproach:
    """How near the drones with the numbers `first` and `second` came, and when."""

    distance_m: float
    first: int
    second: int
    at_s: float


@dataclass(frozen=True)
class LegTimes:
    """A leg of the flight and its time, in seconds from the beginning."""

    title: str
    begins_s: float
    ends_s: float


@dataclass(frozen=True)
class FlightEvent:
    """Something worth telling: when, which drone (its number), and what it does or meets with."""

    at_s: float
    drone: int
    what: str


@dataclass(frozen=True)
class FlightLog:
    """T samples of N drones, `SAMPLE_RATE_HZ`, in metres and seconds from the flight's beginning.

    `attitudes` are unit quaternions x, y, z, w, from the drone's frame to the world's. `errors_m` says how far
    everybody was in the end from the goal that was asked for: 0 for who had none, nan for who has fallen. `nearest` is
    the nearest that two drones came, flying or standing, at any step of the simulation; pairs with one that falls or
    has fallen are counted in `nearest_fallen`. `distance` is the one that was to be kept. `wall_s` is how long the
    simulation took, its planning included. `seen_s` says since when each of the `obstacles` is seen: 0 for those that
    surprise nobody.
    """

    names: tuple[str, ...]
    times: Array
    positions: Array
    attitudes: Array
    legs: tuple[LegTimes, ...]
    events: tuple[FlightEvent, ...]
    errors_m: Array
    nearest: ClosestApproach | None
    nearest_fallen: ClosestApproach | None
    distance: float
    obstacles: tuple[Point, ...]
    wall_s: float
    seen_s: tuple[float, ...] = ()

    @property
    def simulated_s(self) -> float:
        """How long the flight was."""
        return float(self.times[-1])
