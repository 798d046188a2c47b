"""The place of a map's pixels in its frame: from metres to pixels, and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

_Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PixelFrame:
    """The place of a map's pixels. Lengths are in metres.

    Attributes:
        size: The side of a pixel.
        corner: The x and the y of the lower left corner of the lower left pixel.
        yaw: The counterclockwise angle, in radians, by which the pixels are turned around `corner`.
    """

    size: float
    corner: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0

    def moved(self, by: Sequence[float] | _Array, factor: float = 1.0) -> PixelFrame:
        """Return the frame with all lengths multiplied by `factor`, and then moved by an x and a y."""
        x, y = self.corner
        return PixelFrame(factor * self.size, (factor * x + float(by[0]), factor * y + float(by[1])), self.yaw)

    def in_pixels(self, points: _Array) -> _Array:
        """Return points (K, 2), or (K, 3), in pixels (K, 2) from the lower left corner on."""
        x, y = points[:, 0] - self.corner[0], points[:, 1] - self.corner[1]
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return np.column_stack((cosine * x + sine * y, cosine * y - sine * x)) / self.size

    def in_metres(self, places: _Array) -> _Array:
        """Return points (K, 2) that are given in pixels."""
        x, y = self.size * places[:, 0], self.size * places[:, 1]
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return np.column_stack((cosine * x - sine * y + self.corner[0], sine * x + cosine * y + self.corner[1]))
