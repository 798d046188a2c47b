"""The floor plan of a building: walls that no drone can fly over, and routes around these in the plane.

Walls are the pixels of a map that are not free, and the outside of the map. A drone keeps `keep` metres between its
centre and the nearest border of such a pixel, measured exactly, not between centres of pixels.

A route is found on a lattice (`lattice.py`), and then shortened (`string_pulling.py`).
"""

from __future__ import annotations

import math
from dataclasses import field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from robochoc.maps.occupancy.clearance import clearances, parts_per_pixel
from robochoc.maps.routes.distances import Array, Flags
from robochoc.maps.routes.lattice import Lattice
from robochoc.maps.routes.string_pulling import taut
from robochoc.maps.walls import PixelFrame
from robochoc.system.lazy_dataclass import dataclass

SPARE_M = 0.1
"""The additional distance of routes from walls, if the detour is at most a quarter."""
CORNER_M = 0.25
"""The extra length by which a corner is penalized, since drones come to rest there."""
_ROUNDING = 1e-9
"""The tolerance for rounding in distances from walls, in pixels."""


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """Walls, and how far from them drones keep. Lengths are in metres.

    Attributes:
        solid: Which pixels are not free, sorted by y, then x.
        frame: The place of the pixels.
        keep: The distance of a drone's centre from walls.
        parts: The number of lattice points along a pixel's side. 0: a suitable number for `keep`.
    """

    solid: Flags
    frame: PixelFrame
    keep: float
    parts: int = 0
    _routes: dict[bytes, Array | None] = field(default_factory=dict)

    def keeping(self, keep: float) -> FloorPlan:
        """Return the same walls and the same lattice for another distance."""
        return self if keep == self.keep else replace(self, keep=keep, parts=self._parts, _routes={})

    def clearances(self, points: Array, most: float) -> Array:
        """Return the distances (K,) of `points` (K, 2) from the nearest walls, at most `most`."""
        size = self.frame.size
        return size * clearances(self.solid, self.frame.in_pixels(points), most / size)

    def are_clear(self, origins: Array, ends: Array) -> Flags:
        """Return which straight lines (K,), seen from above, are clear of walls."""
        first, last = self.frame.in_pixels(origins), self.frame.in_pixels(ends)
        return np.array([self._sees(*pair, self.keep) for pair in zip(first, last, strict=True)], dtype=bool)

    def route(self, first: Array, second: Array) -> Array | None:
        """Return a short route (K + 1, 2) between two points in the plane; None if there is no route."""
        key = np.concatenate((first[:2], second[:2])).tobytes()
        if key not in self._routes:
            self._routes[key] = self._find_route(first[:2], second[:2])
        return self._routes[key]

    def _find_route(self, first: Array, second: Array) -> Array | None:
        ends = self.frame.in_pixels(np.array([first, second]))
        wish = self.keep + SPARE_M
        if (first == second).all() or self._sees(ends[0], ends[1], wish):
            return np.array([first, second])
        found = self._lattice.path(ends[0], ends[1], lambda a, b: self._sees(a, b, self.keep))
        if found is None:
            return None
        points, wide = found
        roomy = [[self._sees(end, end, wish)] for end in ends]
        wide = np.concatenate((roomy[0], wide, roomy[1]))
        keeps = np.where(wide, wish, self.keep)
        bends = taut(np.vstack((ends[:1], points, ends[1:])), keeps, self._sees, CORNER_M / self.frame.size)
        return np.vstack((first, self.frame.in_metres(bends[1:-1]), second))

    @cached_property
    def _lattice(self) -> Lattice:
        return Lattice(self.solid, self.keep / self.frame.size, SPARE_M / self.frame.size, self._parts)

    @property
    def _parts(self) -> int:
        return self.parts or parts_per_pixel(self.keep / self.frame.size, self.solid.size)

    @cached_property
    def _before(self) -> npt.NDArray[np.int32]:
        """The number of solid pixels in each row before each column."""
        return np.cumsum(np.pad(self.solid, ((0, 0), (1, 0))), axis=1, dtype=np.int32)

    def _sees(self, first: Array, second: Array, keep: float) -> bool:
        """Return whether a straight line, with its ends in pixels, is at least `keep` metres from all walls.

        The thickened line covers an interval of each row of pixels, in which no pixel may be solid.
        """
        radius = keep / self.frame.size
        (x, y), (to_x, to_y) = (first, second) if first[1] <= second[1] else (second, first)
        low, high = math.floor(y - radius + _ROUNDING), math.ceil(to_y + radius - _ROUNDING)
        left, right = min(x, to_x) - radius, max(x, to_x) + radius
        rows, columns = self.solid.shape
        if low < 0 or high > rows or left < -_ROUNDING or right > columns + _ROUNDING:
            return False
        row = np.arange(low, high)
        begins, ends = _covered(row, (x, y), (to_x - x, to_y - y), radius)
        begin = np.floor(begins + _ROUNDING).astype(np.int64).clip(0, columns)
        end = np.ceil(ends - _ROUNDING).astype(np.int64).clip(0, columns)
        return not bool((self._before[row, end] > self._before[row, begin]).any())


def _covered(
    row: npt.NDArray[np.int64], origin: tuple[float, float], along: tuple[float, float], radius: float
) -> tuple[Array, Array]:
    """Return the least and the greatest x that a line with a radius covers in each of the rows that it touches.

    These are the extreme x of the discs around all points on the line, cut to the row. Along the line the greatest x is
    a concave function (the least x a convex function). So its extremum is at an end, where the line enters or leaves
    the row, or where the slope of the disc's border at the row's edge is that of the line.
    """
    (x, y), (right, up) = origin, along
    shares: list[Array] = [np.zeros(len(row)), np.ones(len(row))]
    if up > _ROUNDING:
        lean = radius * abs(right) / math.hypot(right, up)
        shares += [np.asarray((row + at - y) / up) for at in (0.0, 1.0, -lean, 1 + lean)]
    share = np.clip(np.array(shares), 0, 1)
    level = y + up * share
    off = np.maximum(np.maximum(row - level, level - row - 1), 0)
    half = np.sqrt(np.maximum(radius * radius - off * off, 0))
    reached = off <= radius + _ROUNDING
    middle = x + right * share
    least: Array = np.where(reached, middle - half, np.inf).min(axis=0)
    most: Array = np.where(reached, middle + half, -np.inf).max(axis=0)
    return least, most
