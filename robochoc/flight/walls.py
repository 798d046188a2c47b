"""The walls of a mission's map, as data: what drones fly around, and how fast they are to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robochoc.flight.pixel_frame import PixelFrame
from robochoc.formats.ground_map import GroundMap
from robochoc.formats.occupancy.packed import unpacked

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Walls:
    """Walls, and the robots that fly around them. Lengths are in metres.

    Attributes:
        solid: The pixels that are not free: rows from the lowest y on, in each the lowest x first.
        occupied: Those of them that are occupied. Of the others nobody knows.
        frame: Where the pixels lie.
        radius: The robots' radius.
        speed: The mean speed of which the team was told, in m/s.
    """

    solid: Flags
    occupied: Flags
    frame: PixelFrame
    radius: float
    speed: float

    def moved(self, by: Sequence[float] | npt.NDArray[np.float64], factor: float = 1.0) -> Walls:
        """Return the walls with all lengths multiplied by `factor`, and then moved by an x and a y."""
        frame = self.frame.moved(by, factor)
        return Walls(self.solid, self.occupied, frame, factor * self.radius, factor * self.speed)

    @property
    def unknown(self) -> Flags:
        """The pixels that are neither free nor occupied."""
        return self.solid & ~self.occupied


def walls_of(ground: GroundMap | None) -> Walls | None:
    """Return the walls on a map, if it has some."""
    found = ground.walls if ground else None
    if found is None:
        return None
    free, occupied = (unpacked(content, found.rows, found.columns) for content in (found.free, found.occupied))
    frame = PixelFrame(found.resolution, found.corner, found.yaw)
    return Walls(~free, occupied & ~free, frame, found.radius, found.speed)
