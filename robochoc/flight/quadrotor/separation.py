"""The smallest distance between any two drones, measured at every step of a simulation.

Neighbour lists are used as by Verlet ("Computer 'experiments' on classical fluids", 1967): the list has all pairs that
are at most `_REACH_M` further apart than the nearest pair so far. Until a drone has moved by half of `_REACH_M`, no
other pair can be nearer; then the list is computed again. So most steps measure only a few pairs, and the result is
still the minimum over all pairs and steps.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robochoc.flight.log import ClosestApproach
from robochoc.flight.quadrotor.airframe import Array
from robochoc.flight.quadrotor.rigid_bodies import Mask
from robochoc.maps.routes.distances import squashed

_REACH_M = 0.5
_ROUNDING_M = 1e-6
"""A bound on the rounding errors of distances in the list, which are computed by scalar products."""


class SeparationMonitor:
    """Measures the distances between all drones at every step, separately for pairs with a falling or fallen drone.

    In distances, heights are divided by `downwash`.
    """

    def __init__(self, number: int, downwash: float = 1.0) -> None:
        self._downwash = downwash
        self.nearest: ClosestApproach | None = None
        self.nearest_fallen: ClosestApproach | None = None
        self._pairs = np.triu_indices(number, 1)
        self._failed: Mask = np.zeros(number, dtype=np.bool_)
        self._anchor: Array | None = None
        self._first: npt.NDArray[np.intp] = self._pairs[0]
        self._second: npt.NDArray[np.intp] = self._pairs[1]
        self._sound = 0

    def observe(self, places: Array, at_s: float) -> None:
        """Measure the distances between the positions (3, N) at time `at_s`."""
        if not len(self._pairs[0]):
            return
        places = squashed(places.T, self._downwash).T if self._downwash != 1 else places
        if self._anchor is None or self._moved(places, self._anchor):
            self._list(places)
        apart = places.take(self._first, 1)
        apart -= places.take(self._second, 1)
        apart *= apart
        squares = apart[0] + apart[1] + apart[2]
        sound = self._sound
        if sound:
            self.nearest = self._nearer(self.nearest, squares[:sound], 0, at_s)
        if sound < len(squares):
            self.nearest_fallen = self._nearer(self.nearest_fallen, squares[sound:], sound, at_s)

    def exclude(self, failed: Mask) -> None:
        """From now on, count pairs with the drones in `failed` separately."""
        self._failed = failed.copy()
        self._anchor = None

    @staticmethod
    def _moved(places: Array, anchor: Array) -> bool:
        """Return whether a pair that is not on the list may now be the nearest."""
        way = places - anchor
        way *= way
        return bool((way[0] + way[1] + way[2]).max() >= (_REACH_M / 2) ** 2)

    def _list(self, places: Array) -> None:
        first, second = self._pairs
        lengths = np.square(places).sum(0)
        products = places.T @ places
        squares = (lengths[:, None] + lengths - 2 * products)[first, second]
        failed = self._failed[first] | self._failed[second]
        near = np.zeros(len(first), dtype=np.bool_)
        for which, least in ((~failed, self.nearest), (failed, self.nearest_fallen)):
            if which.any():
                best = np.sqrt(max(squares[which].min(), 0))
                if least is not None:
                    best = min(best, least.distance_m)
                near |= which & (squares <= (best + _REACH_M + _ROUNDING_M) ** 2)
        chosen = np.concatenate((np.flatnonzero(near & ~failed), np.flatnonzero(near & failed)))
        self._first, self._second = first[chosen], second[chosen]
        self._sound = int((near & ~failed).sum())
        self._anchor = places.copy()

    def _nearer(
        self, least: ClosestApproach | None, squares: Array, offset: int, at_s: float
    ) -> ClosestApproach | None:
        place = int(squares.argmin())
        distance = float(np.sqrt(squares[place]))
        if least is not None and least.distance_m <= distance:
            return least
        return ClosestApproach(distance, int(self._first[place + offset]), int(self._second[place + offset]), at_s)
