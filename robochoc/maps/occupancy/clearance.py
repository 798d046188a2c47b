"""Distances from the pixels of a map that are not free, and the lattice of points at which a robot fits.

Team generators and flights search for routes on the same lattice, so that the travel times in a team are those of
routes that can be flown. Points are the centres of pixels or, if pixels are large for a robot, of parts of pixels.

Lengths are in pixels. Distances are to the borders of pixels, not to their centres.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robochoc.maps.occupancy.grid import Counts, Flags, summed_area

POINTS_MAX = 4_000_000
_FINE = 4
"""The minimum number of points along the radius of a robot, unless there would be too many points."""
_PARTS_MAX = 9
_ROUNDING = 1e-6
_PORTION = 2_000_000

_Lengths = npt.NDArray[np.int32]
_Places = npt.NDArray[np.float64]


def parts_per_pixel(radius: float, pixels: int) -> int:
    """Return the number of parts of a pixel's side, for robots with a radius on a map of `pixels` pixels.

    The number is odd, so that the centres of pixels are lattice points.
    """
    # The result must not depend on rounding: the same radius must give the same lattice in any unit.
    parts_wished = min(_FINE / max(radius, _ROUNDING) - _ROUNDING, _PARTS_MAX)
    parts = 2 * math.ceil((max(parts_wished, 1) - 1) / 2) + 1
    while parts > 1 and pixels * parts * parts > POINTS_MAX:
        parts -= 2
    return parts


def open_points(solid: Flags, keep: float, parts: int) -> Flags:
    """Return the lattice points at which a robot keeps a distance from solid pixels and from the outside.

    The robot also keeps the distance on straight lines between neighbouring points: half way, only a single corner of a
    wall may be nearer than at both ends. A larger `keep` gives a subset.

    Args:
        solid: Which pixels are not free, by rows.
        keep: The distance to keep.
        parts: The number of parts of a pixel's side: the number of rows, and of columns, of points in a pixel.
    """
    square = (keep * parts) ** 2 + solid.ndim / 4
    flags: Flags = quadruple_squares(solid, parts, math.ceil(math.sqrt(square)) + 1) >= 4 * square
    return flags


def quadruple_squares(solid: Flags, parts: int, reach: int) -> _Lengths:
    """Return four times the squared distances of points from the borders of solid pixels, and from the outside.

    Points are the centres of the parts of pixels, with `parts` parts per side; lengths are in parts. Distances are
    clamped to `reach`. Squares are added up axis by axis.
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
    """Return the distances (K,) of `places` (K, 2) from the nearest solid pixels, at most `most`.

    Places are given as x and y from the lower left corner. Outside the map the distance is 0.
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
