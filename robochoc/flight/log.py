"""The flight log: the data of a flight, for pictures, recordings and reports."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robochoc.flight.layout import Point
from robochoc.system.lazy_dataclass import dataclass

Array = npt.NDArray[np.float64]

SAMPLE_RATE_HZ = 30


@dataclass(frozen=True)
class ClosestApproach:
    """The smallest distance between two drones, by their numbers, and the time of the approach."""

    distance_m: float
    first: int
    second: int
    at_s: float


@dataclass(frozen=True)
class NearestWall:
    """The smallest distance of a drone (by number) from a wall, the time of the approach, and the distance to keep."""

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
    """An event of a drone (by number): a motor stops, an obstacle is seen, or the drone hits the ground."""

    at_s: float
    drone: int
    what: str


@dataclass(frozen=True)
class FlightLog:
    """T samples of N drones, at `SAMPLE_RATE_HZ`. Lengths are in metres, times in seconds from the flight's beginning.

    Attributes:
        names: The drones' names.
        times: (T,): the times of the samples.
        positions: (T, N, 3): the positions of the drones' centres.
        attitudes: (T, N, 4): unit quaternions x, y, z, w from the drone's frame to the world frame.
        legs: The flown legs.
        events: The events of drones.
        errors_m: (N,): each drone's final distance from its last goal; 0 without a goal, nan if it has fallen.
        nearest: The closest approach of two drones, in the air or on the ground, at any step of the simulation.
        nearest_fallen: The closest approach of two drones, at least one of which is falling or has fallen.
        distance: The distance to keep.
        obstacles: All obstacles.
        wall_s: The computation time of simulation and planning.
        seen_s: The time at which each obstacle was first seen; 0 for an obstacle known to the planner.
        downwash: The number by which heights are divided in `nearest` and `distance`.
        nearest_wall: The closest approach to a wall, over all samples of drones that have not fallen; None without
            walls, or if no drone came near to one.
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
        """The duration of the flight, in seconds."""
        return float(self.times[-1])
