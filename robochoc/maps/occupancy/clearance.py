"""Distances from the pixels of a map that are not free, and the lattice of points at which a robot fits.

The generators of teams and the flight search for routes on the same lattice, so that travel times of teams belong to
routes that can be flown. Points are the centres of pixels; if pixels are large for a robot, those of parts of pixels.

Lengths are in sides of a pixel. Distances are to the borders of pixels, not to their centres.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robochoc.maps.occupancy.grid import Counts, Flags, summed_area

POINTS_MAX = 4_000_000
_FINE = 4
"""The least number of points along the radius of a robot, unless there would be too many."""
_PARTS_MAX = 9
_ROUNDING = 1e-6
_PORTION = 2_000_000

_Lengths = npt.NDArray[np.int32]
_Places = npt.NDArray[np.float64]


def parts_per_pixel(radius: float, pixels: int) -> int:
    """Return the number of parts of a pixel's side, for robots of a radius on a map of `pixels` pixels.

    It is odd: then the centres of pixels are points of the lattice.
    """
    # Rounding must not decide: the same radius in metres and in other units has to give the same lattice.
    parts_wished = min(_FINE / max(radius, _ROUNDING) - _ROUNDING, _PARTS_MAX)
    parts = 2 * math.ceil((max(parts_wished, 1) - 1) / 2) + 1
    while parts > 1 and pixels * parts * parts > POINTS_MAX:
        parts -= 2
    return parts


def open_points(solid: Flags, keep: float, parts: int) -> Flags:
    """Return the points of a lattice at which a robot keeps a distance from solid pixels and from the outside.

    It also keeps the distance on the straight line to a neighbouring point: half way, walls may be nearer than at both
    ends by at most a single corner. A larger `keep` gives a subset.

    Args:
        solid: The pixels that are not free, by rows.
        keep: The distance.
        parts: The number of parts of a pixel's side, that is of rows and of columns of points in a pixel.
    """
    square = (keep * parts) ** 2 + solid.ndim / 4
    flags: Flags = quadruple_squares(solid, parts, math.ceil(math.sqrt(square)) + 1) >= 4 * square
    return flags


def quadruple_squares(solid: Flags, parts: int, reach: int) -> _Lengths:
    """Return four times the squared distances of points from the borders of solid pixels, and from the outside.

    Each side has `parts` parts, whose centres are the points; lengths are in parts. Distances are limited to `reach`.
    Squares are added up axis by axis.
    """
    fine = np.pad(solid, 1, constant_values=True)
    for axis in range(solid.ndim):
        fine = np.repeat(fine, parts, axis=axis)
    squares = np.where(fine, 0, (2 * reach + 1) ** 2).astype(np.int32)
    for axis in range(solid.ndim):
        lines = np.moveaxis(squares, axis, 0)
        former = lines.copy()
        for step in range(1, min(reach, len(lines) - 1) + 1):
            off = (2 * step - 1) ** 2
            np.minimum(lines[step:], former[:-step] + off, out=lines[step:])
            np.minimum(lines[:-step], former[step:] + off, out=lines[:-step])
    return squares[(slice(parts, -parts),) * solid.ndim]


def clearances(solid: Flags, places: _Places, most: float) -> _Places:
    """Return the distance (K,) of each of `places` (K, 2) from the nearest solid pixel, at most `most`.

    Places are an x and a y from the lower left corner. Outside of the map the distance is 0.
    """
    found = np.full(len(places), most)
    reach = math.ceil(most) + 1
    padded = np.pad(solid, reach, constant_values=True)
    counts: Counts = summed_area(padded)
    pixels = np.floor(places).astype(np.int64)
    rows, columns = solid.shape
    inside = ((pixels >= 0) & (pixels < (columns, rows))).all(axis=1)
    found[~inside] = 0.0
    x, y = pixels[:, 0].clip(0, columns - 1), pixels[:, 1].clip(0, rows - 1)
    side = 2 * reach + 1
    near = counts[y + side, x + side] - counts[y, x + side] - counts[y + side, x] + counts[y, x]
    asked = np.flatnonzero(inside & (near > 0))
    steps = np.arange(side)
    for some in np.array_split(asked, max(1, len(asked) * side * side // _PORTION)):
        window = padded[(y[some, None] + steps)[:, :, None], (x[some, None] + steps)[:, None, :]]
        gaps = [
            np.maximum(np.maximum(low - at[:, None], at[:, None] - low - 1), 0)
            for at, low in (
                (places[some, 0], x[some, None] + steps - reach),
                (places[some, 1], y[some, None] + steps - reach),
            )
        ]
        apart = np.where(window, np.hypot(gaps[1][:, :, None], gaps[0][:, None, :]), np.inf)
        found[some] = np.minimum(apart.min(axis=(1, 2)), most)
    return found
