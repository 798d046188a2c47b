"""Attitudes of drones as quaternions."""

from __future__ import annotations

import numpy as np

from robochoc.flight.quadrotor.airframe import Array


def quaternions(axes: Array) -> Array:
    """Return unit quaternions x, y, z, w (..., 4) of rotations (..., 3, 3); `[..., k, :]` is the turned axis k.

    After Shepperd, "Quaternion from rotation matrix", 1978: of four ways, the one without cancellation.
    """
    xx, yy, zz = axes[..., 0, 0], axes[..., 1, 1], axes[..., 2, 2]
    squares = np.stack([1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz], axis=-1)
    # The products of each component with all four, times four.
    xy, yz, zx = (axes[..., i, j] + axes[..., j, i] for i, j in ((0, 1), (1, 2), (2, 0)))
    xw, yw, zw = (axes[..., i, j] - axes[..., j, i] for i, j in ((1, 2), (2, 0), (0, 1)))
    rows = np.stack(
        [
            np.stack([squares[..., 0], xy, zx, xw], axis=-1),
            np.stack([xy, squares[..., 1], yz, yw], axis=-1),
            np.stack([zx, yz, squares[..., 2], zw], axis=-1),
            np.stack([xw, yw, zw, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    largest = squares.argmax(-1)[..., None, None]
    found = np.take_along_axis(rows, largest, -2)[..., 0, :]
    return np.asarray(found / np.sqrt(np.square(found).sum(-1, keepdims=True)))
