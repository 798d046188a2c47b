"""The walls of a map for the scene: footprints of pixels, faces of voxels, or faces of blocked cells.

The pixels of a two-dimensional map are merged into a few rectangles. On a three-dimensional map, occupied voxels have
faces towards free voxels; if the voxels are unknown, blocked cells have faces towards free cells. Each face is drawn
from one side only: from outside, the nearer walls and the ceiling are transparent, and the further walls and the floor
are visible.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt

from robochoc.flight.mission import Mission, in_cells
from robochoc.maps.occupancy.rectangles import few_rectangles
from robochoc.maps.walls import PixelFrame, VoxelFrame
from robochoc.system.lazy_dataclass import dataclass
from robochoc.view.meshes import TriangleMesh

_MOST_FACES = 20_000
"""The maximum number of faces for a map. If there are more, the size of voxels is doubled until the limit is met."""

Faces = npt.NDArray[np.float64]
"""The corners of faces (F, 4, 3), counterclockwise as seen from the free side."""
Flags = npt.NDArray[np.bool_]

_MOST_RECTANGLES = 4_000
"""The maximum number of rectangles for a map. If there are more, the size of pixels is doubled until it is met."""

Corners = npt.NDArray[np.float64]
_Cells = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class DrawnWalls:
    """The footprints of walls and of unknown parts: the corners (4, 2) of each rectangle, counterclockwise."""

    occupied: Corners
    unknown: Corners


def wall_footprints(mission: Mission) -> DrawnWalls | None:
    """Return the footprints of a mission's walls, in cells of its box; None without two-dimensional walls."""
    walls = mission.walls
    frame = walls.frame if walls else None
    if walls is None or not isinstance(frame, PixelFrame):
        return None

    def footprints(flags: Flags) -> Corners:
        sides, factor = few_rectangles(flags, _MOST_RECTANGLES)
        left, low, right, high = factor * sides.T
        corners = np.stack([left, low, right, low, right, high, left, high], axis=1).reshape(-1, 2)
        rows, columns = flags.shape
        places = frame.in_metres(np.minimum(corners, (columns, rows)).astype(np.float64))
        flat = np.column_stack((places, np.zeros(len(places))))
        return in_cells(mission, flat)[:, :2].reshape(-1, 4, 2)

    return DrawnWalls(footprints(walls.occupied), footprints(walls.unknown))


def wall_faces(mission: Mission, most: int = _MOST_FACES) -> Faces | None:
    """Return the faces of a mission's voxels in the cells of its box; None if it has no voxels.

    Args:
        mission: The mission.
        most: The maximum number of faces. An enlarged voxel is occupied if any part is occupied, else free if any part
            is free.
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
    """Return the faces of all occupied voxels towards free voxels, in voxels. Flags are sorted by z, y and x."""
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
    """Return flags for voxels of twice the size, which are set if a flag of one of the eight parts is set."""
    even = np.pad(flags, [(0, size % 2) for size in flags.shape])
    for axis in range(3):
        lines = np.moveaxis(even, axis, 0)
        even = np.moveaxis(lines[::2] | lines[1::2], 0, axis)
    return np.asarray(even)


def blocked_cell_faces(blocked: _Cells, sides: _Cells, low: _Cells, high: _Cells, width: float) -> TriangleMesh | None:
    """Return the faces of blocked cells, in cells; None: there are none.

    Args:
        blocked: The cells, a row of x, y and z each.
        sides: The visible sides of each cell, as in `Volume.sides`. Sides towards blocked cells are not visible.
        low: The x, y and z of the first cell of the map.
        high: The x, y and z of the last cell.
        width: The width of a face; if below 1, neighbouring faces are distinguishable.
    """
    taken = {*map(tuple, blocked.tolist())}
    corners = []
    for axis in range(3):
        across = [(axis + 1) % 3, (axis + 2) % 3]
        for number, side in enumerate((-1, 1)):
            beside = blocked.copy()
            beside[:, axis] += side
            inside = ((beside >= low) & (beside <= high)).all(axis=1)
            shown = inside & (sides >> (2 * axis + number) & 1 == 1)
            shown &= np.array([tuple(cell) not in taken for cell in beside.tolist()], dtype=np.bool_)
            face = np.zeros((4, 3))
            face[:, axis] = side / 2
            turn = [(-1, -1), (1, -1), (1, 1), (-1, 1)][::side]  # counterclockwise, seen from the other cell
            face[:, across] = np.array(turn) * width / 2
            corners.append((blocked[shown][:, None, :] + face).reshape(-1, 3))
    return mesh_of_faces(np.concatenate(corners))


def mesh_of_faces(vertices: npt.NDArray[np.float64]) -> TriangleMesh | None:
    """Return a mesh of quadrilaterals, given by four vertices each (4 F, 3); None without faces."""
    if not vertices.size:
        return None
    first = np.arange(0, len(vertices), 4)
    faces = np.concatenate(
        [np.column_stack([first, first + 1, first + 2]), np.column_stack([first, first + 2, first + 3])]
    )
    return TriangleMesh(vertices, faces, np.ones_like(vertices))
