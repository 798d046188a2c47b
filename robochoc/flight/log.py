"""The flight log: what was flown, as data, for pictures, recordings and reports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robochoc.flight.layout import Point

Array = npt.NDArray[np.float64]

SAMPLE_RATE_HZ = 30


@dataclass(frozen=True)
class ClosestApproach:
    """The smallest distance between two drones, by their numbers, and when they had it."""

    distance_m: float
    first: int
    second: int
    at_s: float


@dataclass(frozen=True)
class NearestWall:
    """The smallest distance of a drone, by its number, from a wall, when it had it, and the distance to be kept."""

    distance_m: float
    drone: int
    at_s: float
    set_m: float


@dataclass(frozen=True)
class LegTimes:
    """A leg of the flight: its title, and its times in seconds from the beginning."""

    title: str
    begins_s: float
    ends_s: float


@dataclass(frozen=True)
class FlightEvent:
    """An event of a drone, by its number: a motor stops, an obstacle is seen, the drone hits the ground."""

    at_s: float
    drone: int
    what: str


@dataclass(frozen=True)
class FlightLog:
    """T samples of N drones, at `SAMPLE_RATE_HZ`. Lengths are in metres, times in seconds from the flight's beginning.

    Attributes:
        names: The drones' names.
        times: (T,).
        positions: (T, N, 3), of the drones' centres.
        attitudes: (T, N, 4), unit quaternions x, y, z, w from the drone's frame to the world's.
        legs: The legs that were flown.
        events: What happened to drones.
        errors_m: (N,), each drone's distance from its last goal at the end; 0 without a goal, nan if it has fallen.
        nearest: The closest approach of two drones, in the air or on the ground, at any step of the simulation.
        nearest_fallen: The same of pairs of which at least one has fallen, or falls.
        distance: The distance that was to be kept.
        obstacles: All obstacles.
        wall_s: How long simulation and planning took.
        seen_s: When each obstacle was seen first; 0 for one that the planner knew.
        downwash: The number by which heights are divided in `nearest` and `distance`.
        nearest_wall: The closest approach to a wall, of all samples of drones that have not fallen; None: there are no
            walls, or none came near.
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
    downwash: float = 1.0
    nearest_wall: NearestWall | None = None

    @property
    def simulated_s(self) -> float:
        """Return the duration of the flight in seconds."""
        return float(self.times[-1])
