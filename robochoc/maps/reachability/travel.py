"""Travel between given places of a map, around its walls: lengths of paths, and `robochoc.travel_times`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robochoc.maps.map_file import Map, read_map
from robochoc.maps.occupancy.grid import OccupancyGrid
from robochoc.maps.reachability.cell_size import AnyCells, in_pixels, passable
from robochoc.maps.reachability.cells import Cells, Cubes, Place
from robochoc.maps.reachability.free_space import free_space
from robochoc.maps.reachability.path_lengths import STRAIGHT, UNREACHED, lengths_from
from robochoc.maps.reachability.reachability import off_map, point_text
from robochoc.system.errors import OptionError


class PlaceError(OptionError):
    """Raised for a place outside the map, or at which a robot does not fit."""


class TravelSpace:
    """The space of a robot on a map.

    Args:
        grid: The map.
        radius: The radius of the robot, in metres.
        side: The side length of `cells`, in metres.

    Attributes:
        cells: The cells of the map.

    Raises:
        PlaceError: The radius is too large for this map.
    """

    def __init__(self, grid: Map, radius: Fraction, side: Fraction = Fraction(1)) -> None:
        try:
            if isinstance(grid, OccupancyGrid):
                self.cells: AnyCells = Cells(grid, side, free_space(grid.free, in_pixels(radius, grid.resolution)))
            else:
                self.cells = Cubes(grid, side, passable(grid.free, grid.resolution, radius))
        except ValueError as error:
            raise PlaceError(str(error)) from None

    def check(self, name: str, place: Place) -> None:
        """Raise `PlaceError` if the place of `name` is outside the map, or not free."""
        dimensions = 2 if isinstance(self.cells, Cells) else 3
        if len(place) != dimensions:
            expected = "X, Y and Z, since the map has three dimensions" if dimensions > len(place) else "X and Y only"
            raise PlaceError(f"{name} is at {point_text(place)}: write {expected}")
        pixel = self.cells.pixel(place)
        if pixel is None:
            raise PlaceError(off_map(f"{name} at {point_text(place)}", self.cells))
        if not self.cells.grid.free[pixel]:
            raise PlaceError(f"{name} at {point_text(place)} is in a wall, or in unknown space: move it")

    def fits(self, place: Place) -> bool:
        """Return whether the robot fits at a place on the map."""
        if isinstance(self.cells, Cells):
            return self.cells.fits(place)
        return bool(self.cells.passable[self._pixel(place)])

    def lengths(self, start: Place, ends: Sequence[Place]) -> list[Fraction | None]:
        """Return the lengths of the shortest paths to places on the map, in metres; None for each without a path.

        All places are checked (`check`). Lengths are those of paths between the pixels that contain the places.
        """
        if not self.fits(start):
            return [None] * len(ends)
        joined = self.cells.space.joined if isinstance(self.cells, Cells) else ()
        found = lengths_from(self._pixel(start), self.cells.passable, joined=joined)
        steps = [int(found[self._pixel(end)]) if self.fits(end) else UNREACHED for end in ends]
        return [None if step == UNREACHED else step * self.cells.grid.resolution / STRAIGHT for step in steps]

    def _pixel(self, place: Place) -> tuple[int, ...]:
        pixel = self.cells.pixel(place)
        if pixel is None:
            raise ValueError("the place has not been checked")
        return pixel


def travel_times(
    map: str | os.PathLike[str],  # noqa: A002 - as the key of a list of tasks
    places: npt.ArrayLike,
    *,
    radius: float = 0.2,
    speed: float = 1.0,
) -> npt.NDArray[np.float64]:
    """Return the travel times of a robot between places on a map, around its walls.

    Paths lead over the pixels on which the robot fits: a step to the next pixel counts 15, a diagonal step 21, across
    the corner of a voxel 26, each in fifteenths of a pixel's side. Apart from rounding to pixels at both ends, a time
    without walls in between is from 1 % below to 8 % above that of the straight way (13 % in space).

    Args:
        map: The YAML file of an occupancy grid, as for ROS's map_server, or an OctoMap.
        places: An array (N, 2) of x and y, or (N, 3) on an OctoMap, in metres in the map's frame.
        radius: The radius of the robot, in metres.
        speed: The speed of the robot, in metres per second.

    Returns:
        An array (N, N) of seconds: the entry in row i and column j is the time from place i to place j; infinity if the
        robot cannot get there, or does not fit at one of the places.

    Raises:
        InvalidInputError: The file is not a valid map.
        OptionError: A place is outside the map or in a wall, or a number is out of bounds.

    Example:
        >>> robochoc.travel_times("building.yaml", [[1, 1], [8, 2.5]], speed=0.5)  # doctest: +SKIP
    """
    array = _places_in(places)
    if not (_is_finite(radius) and radius >= 0):
        raise OptionError(f"radius is {radius!r}: use a finite number of at least 0")
    if not (_is_finite(speed) and speed > 0):
        raise OptionError(f"speed is {speed!r}: use a finite number above 0")
    space = TravelSpace(read_map(Path(map)), Fraction(str(float(radius))))
    found = [tuple(Fraction(str(part)) for part in place) for place in array.tolist()]
    for number, place in enumerate(found):
        space.check(f"place {number}", place)
    metres = [[np.inf if one is None else float(one) for one in space.lengths(start, found)] for start in found]
    return np.array(metres, dtype=np.float64).reshape(len(found), len(found)) / speed


def _is_finite(value: object) -> bool:
    """Return whether `value` is a finite number."""
    return isinstance(value, int | float | np.integer | np.floating) and bool(np.isfinite(value))


def _places_in(places: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return places as an array. Raises `OptionError` unless they are finite coordinates."""
    try:
        array = np.asarray(places, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OptionError("places is not an array of numbers: use one row of coordinates for each place") from error
    if array.ndim != 2 or array.shape[1] not in (2, 3):  # noqa: PLR2004 - x, y, z
        raise OptionError(f"places has the shape {array.shape}: use (N, 2), or (N, 3) on an OctoMap")
    if not np.isfinite(array).all():
        number = int(np.argwhere(~np.isfinite(array))[0][0])
        raise OptionError(f"place {number} is {array[number].tolist()}: use finite numbers")
    return array
