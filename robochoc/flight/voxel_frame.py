"""The place of a three-dimensional map's voxels in its frame: from metres to voxels, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

_Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class VoxelFrame:
    """The place of a map's voxels. Lengths are in metres.

    Attributes:
        size: The side of a voxel.
        corner: The x, y and z of the lowest corner of the first voxel.
    """

    size: float
    corner: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def moved(self, by: Sequence[float] | _Array, factor: float = 1.0) -> VoxelFrame:
        """Return the frame with all lengths multiplied by `factor`, and then moved by an x, a y and a z."""
        x, y, z = (factor * own + float(part) for own, part in zip(self.corner, by, strict=True))
        return VoxelFrame(factor * self.size, (x, y, z))

    def in_voxels(self, points: _Array) -> _Array:
        """Return points (K, 3) in voxels from the lowest corner on."""
        return np.asarray((points - np.array(self.corner)) / self.size)

    def in_metres(self, places: _Array) -> _Array:
        """Return points (K, 3) that are given in voxels."""
        return np.asarray(places * self.size + np.array(self.corner))
