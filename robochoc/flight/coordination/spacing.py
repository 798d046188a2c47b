"""The distance that drones keep from each other, and from points at rest, in metres."""

from __future__ import annotations

from typing import Literal

import numpy as np

from robochoc.maps.routes.distances import SLACK_M, Array, Flags, norms, segment_distances
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass


class TooCloseError(RobochocError, ValueError):
    """Two drones, or a drone and a standing point, would rest nearer to each other than the distance.

    `first` and `second` are drones' numbers; the numbers of standing points follow those of drones. `where` is `start`
    if they are too close before the flight, and `goal` if they would be after it.
    """

    def __init__(self, first: int, second: int, distance_m: float, where: Literal["start", "goal"]) -> None:
        self.first = first
        self.second = second
        self.distance_m = distance_m
        self.where = where
        super().__init__(f"the {where}s of drones {first} and {second} are only {distance_m:.3g} m apart")


def check_spacing(points: Array, standing: Array, distance: float, where: Literal["start", "goal"]) -> None:
    """Raise `TooCloseError` for the nearest pair of `points` and `standing`, not both standing, if it is too close."""
    count = len(points)
    if not count:
        return
    everything = np.vstack((points, standing))
    apart = norms(points[:, None] - everything[None])
    apart[np.tril_indices(count, m=len(everything))] = np.inf
    first, second = divmod(int(apart.argmin()), len(everything))
    if apart[first, second] < distance - SLACK_M:
        raise TooCloseError(first, second, float(apart[first, second]), where)


@dataclass(frozen=True)
class Spacing:
    """Checks whether drones keep the `distance` from points at rest."""

    distance: float

    @property
    def least(self) -> float:
        """The distance, less an allowance for rounding."""
        return self.distance - SLACK_M

    def near(self, origins: Array, ends: Array, points: Array) -> Flags:
        """Return which straight lines (K,) pass too near to which `points` (P, 3), as (K, P)."""
        return segment_distances(origins, ends, points) < self.least

    def is_clear(self, path: Array, points: Array) -> bool:
        """Return whether a path keeps the distance from `points`."""
        return not self.near(path[:-1], path[1:], points).any()
