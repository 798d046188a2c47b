"""Walls of a three-dimensional map, to be drawn: the faces of its occupied voxels, as seen from where space is free.

Whoever looks from outside sees through the nearer walls, and the ceiling, onto the further ones and the floor.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt

from robochoc.flight.mission import Mission, in_cells
from robochoc.maps.walls import VoxelFrame

_MOST = 20_000
"""Faces of a map. Where there would be more, voxels are drawn twice as large, and again."""

Faces = npt.NDArray[np.float64]
"""The corners of faces (F, 4, 3), counterclockwise as seen from where space is free."""
Flags = npt.NDArray[np.bool_]


def faces_drawn(mission: Mission, most: int = _MOST) -> Faces | None:
    """Return the faces of a mission's voxels in the cells of its box; None if it has no voxels.

    Args:
        mission: The mission.
        most: The maximum number of faces. Larger voxels are occupied if a part of them is, and free if a part of them
            is and none is occupied.
    """
    walls = mission.walls
    frame = walls.frame if walls else None
    if walls is None or not isinstance(frame, VoxelFrame):
        return None
    occupied, free, factor = walls.occupied, ~walls.solid, 1
    while len(found := faces(occupied, free)) > most:
        factor *= 2
        occupied, free = _halved(occupied), _halved(free)
        free &= ~occupied
    return in_cells(mission, frame.in_metres(factor * found.reshape(-1, 3))).reshape(-1, 4, 3)


def faces(occupied: Flags, free: Flags) -> Faces:
    """Return the faces of all occupied voxels towards free ones, in voxels. Flags are by z, y and x."""
    found = []
    for axis, side in product(range(3), (-1, 1)):
        along = 2 - axis
        beside = np.roll(np.pad(free, 1), -side, axis=along)[1:-1, 1:-1, 1:-1]
        voxels = np.argwhere(occupied & beside)[:, ::-1].astype(np.float64)
        face = np.zeros((4, 3))
        face[:, axis] = (side + 1) / 2
        face[:, [(axis + 1) % 3, (axis + 2) % 3]] = [(0, 0), (1, 0), (1, 1), (0, 1)][::side]
        found.append(voxels[:, None] + face)
    return np.concatenate(found)


def _halved(flags: Flags) -> Flags:
    """Return flags of voxels twice as large: whether one of eight is set."""
    even = np.pad(flags, [(0, size % 2) for size in flags.shape])
    for axis in range(3):
        lines = np.moveaxis(even, axis, 0)
        even = np.moveaxis(lines[::2] | lines[1::2], 0, axis)
    return np.asarray(even)
