"""The blocked cells of a three-dimensional map, as seen from within, where its voxels are not known.

A blocked cell has a face towards each free cell of the map. Each is drawn from that side alone: whoever looks from
outside sees through the nearer walls, and the ceiling, onto the further ones and the floor.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robochoc.view.quadrotor import Shape

_Cells = npt.NDArray[np.int64]


def walls_of(blocked: _Cells, sides: _Cells, low: _Cells, high: _Cells, width: float) -> Shape | None:
    """Return the faces of blocked cells, in cells; None: there are none.

    Args:
        blocked: The cells: x, y and z of each in a row.
        sides: From which sides each is seen, as `Volume` has them. From another blocked cell, none is.
        low: The x, y and z of the first cell of the map.
        high: Those of the last one.
        width: The width of a face: with less than 1, one is told from the next.
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
    return shape_of(np.concatenate(corners))


def shape_of(vertices: npt.NDArray[np.float64]) -> Shape | None:
    """Return faces, of which each has four of the vertices (4 F, 3), as a shape; None: there are none."""
    if not vertices.size:
        return None
    first = np.arange(0, len(vertices), 4)
    faces = np.concatenate(
        [np.column_stack([first, first + 1, first + 2]), np.column_stack([first, first + 2, first + 3])]
    )
    return Shape(vertices, faces, np.ones_like(vertices))
