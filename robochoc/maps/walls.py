"""The walls on a mission's map, and the place of the map's pixels or voxels in its frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from robochoc.maps.ground_map import GroundMap, WallPixels
from robochoc.maps.occupancy.packed import unpacked
from robochoc.system.lazy_dataclass import dataclass

_Array = npt.NDArray[np.float64]


Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Walls:
    """Walls, and the robots that fly around them. Lengths are in metres.

    Attributes:
        solid: Which pixels are not free, sorted by y, then x; on a three-dimensional map which voxels, sorted by z,
            then y, then x.
        occupied: Which of these pixels or voxels are occupied. The others are unknown.
        frame: The place of the pixels or voxels in the map's frame.
        radius: The robots' radius.
        speed: The mean speed of the team's travel times, in m/s.
    """

    solid: Flags
    occupied: Flags
    frame: PixelFrame | VoxelFrame
    radius: float
    speed: float

    def moved(self, by: Sequence[float] | npt.NDArray[np.float64], factor: float = 1.0) -> Walls:
        """Return the walls with all lengths multiplied by `factor`, then moved by the vector `by` (x, y, z)."""
        frame = self.frame.moved(by, factor)
        return Walls(self.solid, self.occupied, frame, factor * self.radius, factor * self.speed)

    @property
    def unknown(self) -> Flags:
        """The pixels, or voxels, that are neither free nor occupied."""
        return self.solid & ~self.occupied


def walls_of(ground: GroundMap | None) -> Walls | None:
    """Return the walls on a map; None for a map without walls."""
    found = (ground.volume.walls if ground.volume else ground.walls) if ground else None
    if found is None:
        return None
    shape = (found.rows, found.columns) if isinstance(found, WallPixels) else (found.levels, found.rows, found.columns)
    free, occupied = (unpacked(content, *shape) for content in (found.free, found.occupied))
    frame: PixelFrame | VoxelFrame
    if isinstance(found, WallPixels):
        frame = PixelFrame(found.resolution, found.corner, found.yaw)
    else:
        frame = VoxelFrame(found.resolution, found.corner)
    return Walls(~free, occupied & ~free, frame, found.radius, found.speed)


@dataclass(frozen=True)
class PixelFrame:
    """The place of a map's pixels. Lengths are in metres.

    Attributes:
        size: The side length of a pixel.
        corner: The x and y of the lower left corner of the lower left pixel.
        yaw: The counterclockwise angle, in radians, by which the pixels are rotated around `corner`.
    """

    size: float
    corner: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0

    def moved(self, by: Sequence[float] | _Array, factor: float = 1.0) -> PixelFrame:
        """Return the frame with all lengths multiplied by `factor`, then moved by the vector `by` (x, y)."""
        x, y = self.corner
        return PixelFrame(factor * self.size, (factor * x + float(by[0]), factor * y + float(by[1])), self.yaw)

    def in_pixels(self, points: _Array) -> _Array:
        """Convert points (K, 2), or (K, 3), to pixels (K, 2) from the lower left corner."""
        x, y = points[:, 0] - self.corner[0], points[:, 1] - self.corner[1]
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return np.column_stack((cosine * x + sine * y, cosine * y - sine * x)) / self.size

    def in_metres(self, places: _Array) -> _Array:
        """Convert points (K, 2) from pixels to metres."""
        x, y = self.size * places[:, 0], self.size * places[:, 1]
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return np.column_stack((cosine * x - sine * y + self.corner[0], sine * x + cosine * y + self.corner[1]))


@dataclass(frozen=True)
class VoxelFrame:
    """The place of a map's voxels. Lengths are in metres.

    Attributes:
        size: The side length of a voxel.
        corner: The x, y and z of the lowest corner of the first voxel.
    """

    size: float
    corner: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def moved(self, by: Sequence[float] | _Array, factor: float = 1.0) -> VoxelFrame:
        """Return the frame with all lengths multiplied by `factor`, then moved by the vector `by` (x, y, z)."""
        x, y, z = (factor * own + float(part) for own, part in zip(self.corner, by, strict=True))
        return VoxelFrame(factor * self.size, (x, y, z))

    def in_voxels(self, points: _Array) -> _Array:
        """Convert points (K, 3) to voxels from the lowest corner."""
        return np.asarray((points - np.array(self.corner)) / self.size)

    def in_metres(self, places: _Array) -> _Array:
        """Convert points (K, 3) from voxels to metres."""
        return np.asarray(places * self.size + np.array(self.corner))
