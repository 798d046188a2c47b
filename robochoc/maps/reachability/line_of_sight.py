"""Lines of sight between cells: straight lines that touch only free pixels, or voxels.

Computations are exact, since places are integers in a fraction of a pixel. So visibility is symmetric, and a line that
just touches the corner of a wall is blocked on every machine.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from math import lcm

import numpy as np
import numpy.typing as npt

from robochoc.maps.reachability.cell_size import AnyCells
from robochoc.maps.reachability.cells import Cells, Cubes, Place

MAX_PAIRS = 100_000
"""The maximum number of pairs of cells within the sensing range."""

Point = tuple[int, ...]


class LinesOfSight(ABC):
    """Finds lines of sight between the free cells of a map."""

    def __init__(self, cells: AnyCells) -> None:
        self._cells = cells
        places = [self._in_pixels(cell) for cell in cells.free]
        self._unit = lcm(1, *(part.denominator for place in places for part in place))
        """The side length of a pixel, in these integers."""
        self._points: dict[int, Point] = {
            cell: tuple(int(part * self._unit) for part in place)
            for cell, place in zip(cells.free, places, strict=True)
        }

    @abstractmethod
    def is_clear(self, one: int, other: int) -> bool:
        """Return whether the straight line between two free cells touches only free pixels."""

    @abstractmethod
    def _in_pixels(self, cell: int) -> Place:
        """Return the place of a cell's centre, in pixels from the lower left corner of the map."""

    def visible_cells(self, sensing: Fraction) -> dict[int, frozenset[int]]:
        """Return the cells visible from each free cell within the range `sensing` in metres, including the cell itself.

        Raises:
            ValueError: More than `MAX_PAIRS` pairs of cells are within the range.
        """
        reach = (sensing / self._cells.grid.resolution * self._unit) ** 2
        near = [
            (one, other)
            for (one, here), (other, there) in combinations(self._points.items(), 2)
            if sum((a - b) ** 2 for a, b in zip(here, there, strict=True)) <= reach
        ]
        if len(near) > MAX_PAIRS:
            raise ValueError(
                f"{len(near):,} pairs of cells are within the sensing range, more than {MAX_PAIRS:,};"
                " use larger cells, or a smaller sensing range"
            )
        found = {cell: {cell} for cell in self._points}
        for one, other in near:
            if self.is_clear(one, other):
                found[one].add(other)
                found[other].add(one)
        return {cell: frozenset(others) for cell, others in found.items()}


class _SightOnGround(LinesOfSight):
    """Finds lines of sight on a two-dimensional map."""

    def __init__(self, cells: Cells) -> None:
        self._grid = cells.grid
        super().__init__(cells)

    def is_clear(self, one: int, other: int) -> bool:
        (x, y), (right, end) = sorted((self._points[one], self._points[other]))
        unit, across, up = self._unit, right - x, end - y
        solid = self._solid
        for column in range(_first_touched(x, unit), right // unit + 1):
            if across:
                # The heights at the borders of the column, multiplied by `across`, since fractions would be slower.
                left = max(x, column * unit) - x
                back = min(right, (column + 1) * unit) - x
                low, high = sorted((y * across + left * up, y * across + back * up))
                size = unit * across
            else:
                (low, high), size = sorted((y, end)), unit
            if solid[high // size + 1, column] > solid[_first_touched(low, size), column]:
                return False
        return True

    @cached_property
    def _solid(self) -> npt.NDArray[np.int64]:
        """The number of pixels below each row that are not free, by column."""
        return np.cumsum(np.pad(~self._grid.free, ((1, 0), (0, 0))), axis=0, dtype=np.int64)

    def _in_pixels(self, cell: int) -> Place:
        x, y = self._cells.centre(cell)
        return self._grid.in_pixels((x, y))


class _SightInSpace(LinesOfSight):
    """Finds lines of sight on a three-dimensional map: by layers of voxels along x, and by rows along y in each."""

    def __init__(self, cells: Cubes) -> None:
        self._grid = cells.grid
        super().__init__(cells)

    def is_clear(self, one: int, other: int) -> bool:
        (x, y, z), (right, back, top) = sorted((self._points[one], self._points[other]))
        across, along, up = right - x, back - y, top - z
        whole = (across or 1) * (abs(along) or 1)
        """The length of the line, chosen such that it crosses borders between layers and rows at integers."""
        size, solid = self._unit * whole, self._solid
        for column, begin, end in _crossed(x, across, (0, whole), whole, self._unit):
            for row, first, last in _crossed(y, along, (begin, end), whole, self._unit):
                low, high = sorted((z * whole + up * first, z * whole + up * last))
                if solid[high // size + 1, row, column] > solid[_first_touched(low, size), row, column]:
                    return False
        return True

    @cached_property
    def _solid(self) -> npt.NDArray[np.int32]:
        """The number of voxels below each voxel that are not free."""
        return np.cumsum(np.pad(~self._grid.free, ((1, 0), (0, 0), (0, 0))), axis=0, dtype=np.int32)

    def _in_pixels(self, cell: int) -> Place:
        return self._grid.in_voxels(self._cells.centre(cell))


def lines_of_sight(cells: AnyCells) -> LinesOfSight:
    """Return the lines of sight on a map."""
    return _SightInSpace(cells) if isinstance(cells, Cubes) else _SightOnGround(cells)


def _crossed(place: int, moved: int, part: tuple[int, int], whole: int, unit: int) -> Iterator[tuple[int, int, int]]:
    """Yield the layers that a part of a line touches along an axis, each with the positions of entry and exit.

    Args:
        place: The coordinate of the line's beginning on the axis.
        moved: The extent of the line along the axis.
        part: The part of the line, within 0 and `whole`.
        whole: The length of the line, a multiple of `moved`.
        unit: The height of a layer.
    """
    ends = sorted(place * whole + moved * at for at in part)
    for layer in range(_first_touched(ends[0], unit * whole), ends[1] // (unit * whole) + 1):
        if moved:
            borders = sorted((border * unit - place) * (whole // moved) for border in (layer, layer + 1))
            yield layer, max(borders[0], part[0]), min(borders[1], part[1])
        else:
            yield layer, *part


def _first_touched(place: int, size: int) -> int:
    """Return the first pixel, of side `size`, that touches a place: on a border, the pixel before the border."""
    return -(-place // size) - 1
