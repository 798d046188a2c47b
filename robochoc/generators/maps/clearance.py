"""The voxels of a map in which a robot fits: obstacles are inflated by its radius. For pixels see `room.py`."""

from __future__ import annotations

from fractions import Fraction
from math import floor

import numpy as np

from robochoc.formats.occupancy.grid import Flags

MAX_RADIUS = 100
"""The maximum radius of a robot, in pixels."""


def in_pixels(radius: Fraction, resolution: Fraction) -> Fraction:
    """Return a radius in sides of a pixel. Raises `ValueError` where it has more than `MAX_RADIUS`."""
    if radius > MAX_RADIUS * resolution:
        raise ValueError(f"radius is {float(radius):g} m, more than {MAX_RADIUS} pixels of this map")
    return radius / resolution


def passable(free: Flags, resolution: Fraction, radius: Fraction) -> Flags:
    """Return the pixels where the centre of a robot can be: no pixel that is not free is nearer than its radius.

    Obstacles are inflated, as costmap_2d does with the inscribed radius. Distances are between centres of pixels.
    What lies outside of the map is not free. Squares of distances are added up axis by axis, as far as they matter.

    Args:
        free: Which pixels are free, in an array of two dimensions or three.
        resolution: The side of a pixel in metres.
        radius: The radius in metres.

    Raises:
        ValueError: The radius has more than `MAX_RADIUS` pixels.
    """
    limit = floor(in_pixels(radius, resolution) ** 2)
    beyond = limit + 1
    squares = np.where(free, beyond, 0).astype(np.int32)
    for axis in range(free.ndim):
        lines = np.moveaxis(squares, axis, 0)
        before = lines.copy()
        for step in range(1, len(lines) + 1):
            if step * step > limit:
                break
            np.minimum(lines[step:], before[:-step] + step * step, out=lines[step:])
            np.minimum(lines[:-step], before[step:] + step * step, out=lines[:-step])
            for edge in (lines[step - 1], lines[len(lines) - step]):
                np.minimum(edge, step * step, out=edge)
    return squares > limit
