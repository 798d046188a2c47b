"""What was flown: a pure record, for pictures, files and reports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robochoc.flight.layout import Point

Array = npt.NDArray[np.float64]

SAMPLES_A_SECOND = 30


@dataclass(frozen=True)
class Nearest:
    """How near the drones with the numbers `first` and `second` came, and when."""

    distance_m: float
    first: int
    second: int
    at_s: float


@dataclass(frozen=True)
class Stage:
    """A leg of the flight and its time, in seconds from the beginning."""

    title: str
    begins_s: float
    ends_s: float


@dataclass(frozen=True)
class Happening:
    """Something worth telling: when, which drone (its number), and what it does or meets with."""

    at_s: float
    drone: int
    what: str


@dataclass(frozen=True)
class Flown:
    """T samples of N drones, `SAMPLES_A_SECOND`, in metres and seconds from the flight's beginning.

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
    stages: tuple[Stage, ...]
    happenings: tuple[Happening, ...]
    errors_m: Array
    nearest: Nearest | None
    nearest_fallen: Nearest | None
    distance: float
    obstacles: tuple[Point, ...]
    wall_s: float
    seen_s: tuple[float, ...] = ()

    @property
    def simulated_s(self) -> float:
        """How long the flight was."""
        return float(self.times[-1])
