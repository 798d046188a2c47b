"""What was flown: a pure record, for pictures, files and reports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robochoc.flight.layout import Point
from robochoc.flight.quadrotor.airframe import Array
from robochoc.flight.quadrotor.nearest import Nearest

SAMPLES_A_SECOND = 30


@dataclass(frozen=True)
class Stage:
    """A leg of the flight and its time, in seconds from the beginning."""

    title: str
    begins_s: float
    ends_s: float


@dataclass(frozen=True)
class Happening:
    """Something worth telling: when, which drone (its number), and what it does or meets with."""

    at_s: float
    drone: int
    what: str


@dataclass(frozen=True)
class Flown:
    """T samples of N drones, `SAMPLES_A_SECOND`, in metres and seconds from the flight's beginning.

    `attitudes` are unit quaternions x, y, z, w, from the drone's frame to the world's. `errors_m` says how far
    everybody was in the end from the goal that was asked for: 0 for who had none, nan for who has fallen. `nearest` is
    the nearest that two drones came, flying or standing, at any step of the simulation; pairs with one that falls or
    has fallen are counted in `nearest_fallen`. `distance` is the one that was to be kept. `wall_s` is how long the
    simulation took, its planning included. `seen_s` says since when each of the `obstacles` is seen: 0 for those that
    surprise nobody.
    """

    names: tuple[str, ...]
    times: Array
    positions: Array
    attitudes: Array
    stages: tuple[Stage, ...]
    happenings: tuple[Happening, ...]
    errors_m: Array
    nearest: Nearest | None
    nearest_fallen: Nearest | None
    distance: float
    obstacles: tuple[Point, ...]
    wall_s: float
    seen_s: tuple[float, ...] = ()

    @property
    def simulated_s(self) -> float:
        """How long the flight was."""
        return float(self.times[-1])


def quaternions(axes: Array) -> Array:
    """(..., 4) x y z w of rotations (..., 3, 3), of which `[..., k, :]` is the turned axis k.

    By Shepperd, "Quaternion from rotation matrix", 1978: of four ways the one without cancellation.
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
