"""The walls of a mission's map, as data: what drones fly around, and how fast they are to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robochoc.flight.pixel_frame import PixelFrame
from robochoc.flight.voxel_frame import VoxelFrame
from robochoc.maps.ground_map import GroundMap, WallPixels
from robochoc.maps.occupancy.packed import unpacked

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Walls:
    """Walls, and the robots that fly around them. Lengths are in metres.

    Attributes:
        solid: The pixels that are not free: rows from the lowest y on, in each the lowest x first. On a map in three
            dimensions the voxels, by z, then y, then x.
        occupied: Those of them that are occupied. Of the others nobody knows.
        frame: Where they lie.
        radius: The robots' radius.
        speed: The mean speed of which the team was told, in m/s.
    """

    solid: Flags
    occupied: Flags
    frame: PixelFrame | VoxelFrame
    radius: float
    speed: float

    def moved(self, by: Sequence[float] | npt.NDArray[np.float64], factor: float = 1.0) -> Walls:
        """Return the walls with all lengths multiplied by `factor`, and then moved by an x, a y and a z."""
        frame = self.frame.moved(by, factor)
        return Walls(self.solid, self.occupied, frame, factor * self.radius, factor * self.speed)

    @property
    def unknown(self) -> Flags:
        """The pixels, or voxels, that are neither free nor occupied."""
        return self.solid & ~self.occupied


def walls_of(ground: GroundMap | None) -> Walls | None:
    """Return the walls on a map, if it has some."""
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
