"""The free space of a robot on a two-dimensional map: the points at which it fits, and connections between pixels.

Distances are measured to the borders of pixels, so that no path leads through a door that is narrower than the robot.
The lattice of points is the same as for flights (`maps/occupancy/clearance.py`): drones can fly between connected
pixels.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from math import floor

import numpy as np

from robochoc.maps.occupancy.clearance import clearances, open_points, parts_per_pixel
from robochoc.maps.occupancy.grid import Counts, Flags
from robochoc.system.lazy_dataclass import dataclass

_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """The free space of a robot. Lengths are in sides of a pixel.

    Attributes:
        solid: Which pixels are not free.
        radius: The robot's radius.
        parts: The number of lattice points along a pixel's side.
        points: The points at which the robot can be, of which each pixel has only the largest connected group.
    """

    solid: Flags
    radius: float
    parts: int
    points: Flags

    @cached_property
    def passable(self) -> Flags:
        """The pixels in which the robot can be."""
        return np.asarray(self._by_pixel.any(axis=(1, 3)))

    @property
    def is_whole(self) -> Flags:
        """The pixels in which the robot can be at all points of the lattice."""
        return np.asarray(self._by_pixel.all(axis=(1, 3)))

    @cached_property
    def joined(self) -> tuple[Flags, Flags]:
        """The pixels from which the robot can move directly to the next row, and to the next column."""
        points, up, right = self._by_pixel, np.zeros_like(self.solid), np.zeros_like(self.solid)
        up[:-1] = (points[:-1, -1] & points[1:, 0]).any(axis=2)
        right[:, :-1] = (points[:, :, :-1, -1] & points[:, :, 1:, 0]).any(axis=1)
        return up, right

    def fits(self, place: tuple[Fraction, Fraction]) -> bool:
        """Return whether the robot fits at a place (x and y) on the map, and can move from there."""
        column, row = (floor(part * self.parts) for part in place)
        return bool(self.points[row, column]) and bool(self.is_clear([place])[0])

    def is_clear(self, places: list[tuple[Fraction, Fraction]]) -> Flags:
        """Return which places (K,) are at least the radius away from all solid pixels."""
        found = np.array(places, dtype=np.float64).reshape(-1, 2)
        flags: Flags = clearances(self.solid, found, self.radius) >= self.radius - _ROUNDING
        return flags

    @cached_property
    def _by_pixel(self) -> Flags:
        """The points, by row of pixels, row in the pixel, column of pixels, and column in the pixel."""
        rows, columns = self.solid.shape
        return self.points.reshape(rows, self.parts, columns, self.parts)


def free_space(free: Flags, radius: Fraction) -> FreeSpace:
    """Return the free space, on a map with `free` pixels, of a robot whose radius is given in pixels."""
    solid, parts = ~free, parts_per_pixel(float(radius), free.size)
    return FreeSpace(solid, float(radius), parts, _largest_groups(open_points(solid, float(radius), parts), parts))


def _largest_groups(points: Flags, parts: int) -> Flags:
    """Return the largest connected group of points in each pixel."""
    rows, columns = (size // parts for size in points.shape)
    blocks = points.reshape(rows, parts, columns, parts).transpose(0, 2, 1, 3)
    counts = blocks.sum(axis=(2, 3))
    some = (counts > 0) & (counts < parts * parts)
    groups = _grouped(blocks[some])
    most = parts * parts + 1
    numbers = groups + most * np.arange(len(groups))[:, None, None]
    sizes = np.bincount(numbers.ravel(), minlength=most * len(groups)).reshape(-1, most)
    sizes[:, 0] = 0  # group 0 has the positions without a point
    kept = blocks.copy()
    kept[some] = groups == sizes.argmax(axis=1)[:, None, None]
    return kept.transpose(0, 2, 1, 3).reshape(points.shape)


def _grouped(blocks: Flags) -> Counts:
    """Return the group number (from 1) of each point in the blocks (K, N, N); 0 if there is no point."""
    side = blocks.shape[1]
    groups: Counts = np.where(blocks, np.arange(1, side * side + 1).reshape(side, side), 0)
    while True:
        around = np.pad(groups, ((0, 0), (1, 1), (1, 1)))
        beside = (around[:, 1:-1, 1:-1], around[:, 2:, 1:-1], around[:, :-2, 1:-1], around[:, 1:-1, 2:])
        further = np.where(blocks, np.maximum.reduce([*beside, around[:, 1:-1, :-2]]), 0)
        if (further == groups).all():
            return groups
        groups = further
