"""An index of points in space that finds those near another one at once, however many there are."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

from robochoc.flight.layout import Point

_Cell = tuple[int, int, int]
_A_HAIR_MORE = 1 + 1e-9
"""A point just beyond a cube's side may still be near: distances are rounded."""


class PointIndex:
    """Points, kept by the unit cube in which they lie. The same point may be added several times.

    `cubes` counts those that have points: others take no memory.
    """

    def __init__(self) -> None:
        self._cubes: dict[_Cell, list[Point]] = {}
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def cubes(self) -> int:
        """Return how many cubes have points."""
        return len(self._cubes)

    def add(self, place: Point) -> None:
        """Add a point."""
        x, y, z = map(math.floor, place)
        self._cubes.setdefault((x, y, z), []).append(place)
        self._count += 1

    def any_near(self, place: Point, within: float) -> bool:
        """Return whether a point is no further than `within` from `place`."""
        return any(
            math.dist(place, other) <= within for cell in self._around(place, within) for other in self._cubes[cell]
        )

    def remove_near(self, place: Point, within: float) -> bool:
        """Remove the points no further than `within` from `place`; return whether there were any."""
        before = self._count
        for cell in self._around(place, within):
            points = self._cubes.pop(cell)
            far = [other for other in points if math.dist(place, other) > within]
            self._count -= len(points) - len(far)
            if far:
                self._cubes[cell] = far
        return self._count < before

    def _around(self, place: Point, within: float) -> Iterator[_Cell]:
        """Yield the cubes that have points, of those that are no further than `within`."""
        reach = within * _A_HAIR_MORE
        spans = (range(math.floor(at - reach), math.floor(at + reach) + 1) for at in place)
        for x, y, z in product(*spans):
            if (x, y, z) in self._cubes:
                yield x, y, z
