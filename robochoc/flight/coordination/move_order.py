"""Moves of drones one after the other, in any space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, TypeVar

import numpy as np

from robochoc.flight.coordination.spacing import Spacing
from robochoc.maps.routes.distances import Array, norms
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

_Space = TypeVar("_Space", bound=Spacing)


class NoRouteError(RobochocError, ValueError):
    """No order of moves was found in which `drones` reach their goals.

    Standing points enclose these drones or, if `indoors`, drones block each other between walls.
    """

    def __init__(self, drones: Sequence[int], *, indoors: bool = False) -> None:
        self.drones = tuple(drones)
        self.indoors = indoors
        names = ", ".join(map(str, self.drones))
        why = "they do not get past each other" if indoors else "standing points enclose where they start or end"
        super().__init__(f"no way was found for drones {names} ({why})")


@dataclass(frozen=True)
class DroneMove:
    """A drone's move along a path (K + 1, 3), from rest to rest."""

    drone: int
    path: Array
    points: Array
    """The places of all drones that rest during the move. An alternative path must also be clear of these places."""


class MoveOrder(Generic[_Space]):
    """The moves so far, and the places of all drones after them."""

    def __init__(self, starts: Array, goals: Array, standing: Array, space: _Space, delays: Array) -> None:
        self.goals = goals
        self.delays = delays
        self.space = space
        self.count = len(starts)
        self.points = np.vstack((starts, standing))
        """The positions of all drones, followed by the standing points."""
        self.rests = self.points[: self.count]
        self.moves: list[DroneMove] = []

    def others(self, drone: int) -> Array:
        """Return the places of all other drones, and all standing points."""
        return np.delete(self.points, drone, axis=0)

    def move(self, drone: int, path: Array) -> None:
        """Move a drone."""
        self.moves.append(DroneMove(drone, path, self.others(drone)))
        self.points[drone] = path[-1]

    def goal_is_free(self, drone: int) -> bool:
        """Return whether nothing rests too near to a drone's goal."""
        return bool((norms(self.others(drone) - self.goals[drone]) >= self.space.least).all())
