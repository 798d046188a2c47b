"""The walls, floors and ceilings on a three-dimensional map, and routes around them.

Walls are the voxels of a map that are not free, and the outside of the map. A drone keeps `keep` metres between its
centre and the nearest border of such a voxel. A route is found on a lattice (`lattice.py`), or on a finer lattice if
the first has no route, and then shortened (`string_pulling.py`). Routes can also keep a distance from other drones.
"""

from __future__ import annotations

import math
from dataclasses import field, replace

import numpy as np

from robochoc.maps.routes.distances import SLACK_M, Array, Flags, segment_distances, squashed
from robochoc.maps.routes.floor_plan import CORNER_M, SPARE_M
from robochoc.maps.routes.lattice import Lattice, Numbers
from robochoc.maps.routes.string_pulling import taut
from robochoc.maps.routes.voxel_surface import VoxelSurface
from robochoc.maps.walls import VoxelFrame
from robochoc.system.lazy_dataclass import dataclass

_FINE = (2, 4)
"""The numbers of points in each lattice per distance of drones from walls."""
_FINE_M = 0.04
"""The minimum distance between points."""
_POINTS_MAX = 4_000_000


@dataclass(frozen=True, eq=False)
class Resting:
    """Drones at rest, from which routes keep a distance.

    Attributes:
        points: The places (K, 3) of these drones, in metres.
        distance: The distance to keep.
        downwash: The number by which heights are divided in distances.
    """

    points: Array
    distance: float
    downwash: float = 1.0

    @property
    def radii(self) -> Array:
        """The semi-axes of the closed ellipsoid around each drone."""
        return self.distance * np.array([1.0, 1.0, self.downwash])

    def clear(self, origins: Array, ends: Array) -> Flags:
        """Return which straight lines (K,) keep the distance from all these drones."""
        flat = (squashed(points, self.downwash) for points in (origins, ends, self.points))
        apart = segment_distances(*flat).min(axis=1, initial=math.inf)
        return np.asarray(apart >= self.distance - SLACK_M / 2)


@dataclass(frozen=True, eq=False)
class VoxelPlan:
    """Walls in space, and how far from them drones keep. Lengths are in metres.

    Attributes:
        solid: Which voxels are not free, sorted by z, then y, then x.
        frame: The place of the voxels.
        keep: The distance of a drone's centre from walls.
    """

    solid: Flags
    frame: VoxelFrame
    keep: float
    _surfaces: list[VoxelSurface] = field(default_factory=list)
    _routes: dict[bytes, tuple[int, Array] | None] = field(default_factory=dict)
    _lattices: dict[int, Lattice] = field(default_factory=dict)

    def keeping(self, keep: float) -> VoxelPlan:
        """Return the same walls for another distance."""
        return (
            self if keep == self.keep else replace(self, keep=keep, _surfaces=[self._surface], _routes={}, _lattices={})
        )

    def clearances(self, points: Array, most: float) -> Array:
        """Return the distances (K,) of `points` (K, 3) from the nearest walls, at most `most`."""
        found = self._surface.distances(self.frame.in_voxels(points), most / self.frame.size)
        return np.asarray(np.minimum(self.frame.size * found, most))

    def are_clear(self, origins: Array, ends: Array) -> Flags:
        """Return which straight lines (K,) are clear of walls."""
        first, last = self.frame.in_voxels(origins), self.frame.in_voxels(ends)
        return np.array([self._sees(*pair, self.keep) for pair in zip(first, last, strict=True)], dtype=bool)

    def floor(self, place: Array) -> float | None:
        """Return the height of the floor below a place; None in a wall, or outside the map."""
        voxel = np.floor(self.frame.in_voxels(place[None])[0]).astype(np.int64)
        if (voxel < 0).any() or (voxel >= self.solid.shape[::-1]).any():
            return None
        x, y, z = voxel.tolist()
        if self.solid[z, y, x]:
            return None
        below = np.flatnonzero(self.solid[:z, y, x])
        return self.frame.corner[2] + self.frame.size * (int(below[-1]) + 1 if len(below) else 0)

    def route(self, first: Array, second: Array) -> Array | None:
        """Return a short route (K + 1, 3) between two points; None if there is no route."""
        found = self._known(first, second)
        return found and found[1]

    def route_among(self, first: Array, second: Array, others: Resting) -> Array | None:
        """Return a short route (K + 1, 3) that also avoids drones at rest; None if no route is found."""
        known = self._known(first, second)
        if known is None:
            return None
        level, way = known
        if others.clear(way[:-1], way[1:]).all():
            return way
        found = self._find_route(first, second, others, level)
        return found and found[1]

    def reached(self, start: Array, others: Resting, most: float) -> Array:
        """Return points (K, 3) that can be reached from `start`, the nearest first.

        Routes to these points avoid drones at rest, and are at most `most` long.
        """
        end = self.frame.in_voxels(start[None])[0]
        places = self._lattice(0).reached(
            end, lambda a, b: self._clear(a, b, self.keep, others), self._closed(0, others), most / self.frame.size
        )
        return self.frame.in_metres(places)

    def _known(self, first: Array, second: Array) -> tuple[int, Array] | None:
        key = np.concatenate((first, second)).tobytes()
        if key not in self._routes:
            self._routes[key] = self._find_route(first, second)
        return self._routes[key]

    def _find_route(
        self, first: Array, second: Array, others: Resting | None = None, last: int = len(_FINE) - 1
    ) -> tuple[int, Array] | None:
        """Return a route, and the number of the lattice, up to `last`, on which it was found."""
        ends = self.frame.in_voxels(np.array([first, second]))
        wish = self.keep + SPARE_M
        if (first == second).all() or self._clear(ends[0], ends[1], wish, others):
            return 0, np.array([first, second])

        def sees(one: Array, other: Array, keep: float) -> bool:
            return self._clear(one, other, keep, others)

        for level in range(last + 1):
            without = None if others is None else self._closed(level, others)
            found = self._lattice(level).path(ends[0], ends[1], lambda a, b: sees(a, b, self.keep), without)
            if found is not None:
                points, wide = found
                roomy = [[self._sees(end, end, wish)] for end in ends]
                keeps = np.where(np.concatenate((roomy[0], wide, roomy[1])), wish, self.keep)
                bends = taut(np.vstack((ends[:1], points, ends[1:])), keeps, sees, CORNER_M / self.frame.size)
                return level, np.vstack((first, self.frame.in_metres(bends[1:-1]), second))
        return None

    def _closed(self, level: int, others: Resting) -> Numbers:
        """Return the points of a lattice that are too near to drones at rest."""
        places, radii = self.frame.in_voxels(others.points), others.radii / self.frame.size
        near = [self._lattice(level).around(place, radii) for place in places]
        return np.concatenate(near) if near else np.empty(0, dtype=np.int64)

    def _clear(self, first: Array, second: Array, keep: float, others: Resting | None) -> bool:
        if others is not None:
            line = self.frame.in_metres(np.array([first, second]))
            if not others.clear(line[:1], line[1:])[0]:
                return False
        return self._sees(first, second, keep)

    def _sees(self, first: Array, second: Array, keep: float) -> bool:
        """Return whether a straight line, with its ends in voxels, is at least `keep` metres from all walls."""
        return self._surface.clear(first, second, keep / self.frame.size)

    @property
    def _surface(self) -> VoxelSurface:
        if not self._surfaces:
            self._surfaces.append(VoxelSurface(self.solid))
        return self._surfaces[0]

    def _lattice(self, level: int) -> Lattice:
        if level not in self._lattices:
            size = self.frame.size
            wish = max(self.keep / _FINE[level], _FINE_M)
            parts = max(1, math.ceil(size / wish - SLACK_M))
            while parts > 1 and self.solid.size * parts**3 > _POINTS_MAX:
                parts -= 1
            every = max(1, min(math.floor(wish / size + SLACK_M), *self.solid.shape)) if parts == 1 else 1
            self._lattices[level] = Lattice(self.solid, self.keep / size, SPARE_M / size, parts, every)
        return self._lattices[level]
