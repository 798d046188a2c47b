"""The lengths of ways between the places of a list: along streets, straight, or around the walls of a map."""

from __future__ import annotations

from abc import ABC, abstractmethod
from fractions import Fraction

from robochoc.model.allocation import Distance, distance_between
from robochoc.system.lazy_dataclass import dataclass
from robochoc.tasks.entries import Point

_HALF = Fraction(1, 2)


class Ways(ABC):
    """Measures ways between places."""

    @abstractmethod
    def length(self, start: Point, end: Point, places: int, radius: Fraction) -> int | None:
        """Return the length of the shortest way of a robot, in units of 10**-places, rounded half up.

        The length is 0 if one of the places is empty, and None if the robot cannot reach the end.
        """


@dataclass(frozen=True)
class PlainWays(Ways):
    """Ways without obstacles."""

    distance: Distance

    def length(self, start: Point, end: Point, places: int, radius: Fraction) -> int | None:  # noqa: ARG002 - no walls
        """Return the distance."""
        return distance_between(start, end, self.distance, places) if start and end else 0
