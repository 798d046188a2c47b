"""Shortest routes on a lattice of points that are far enough from all walls, in two or three dimensions.

Routes are found by A* (Hart, Nilsson, Raphael 1968) in integers, on points with 8 or 26 neighbours. The lengths of
steps are 15, 21 and 26, as in the travel times of generated teams (`reachability/path_lengths.py`), multiplied by four
far from walls, and by five near walls. Points whose estimates differ by less than a step are expanded together, and
again if a shorter route to them is found.

Points are the centres of pixels or voxels. If pixels are large for a drone, points are the centres of parts of pixels;
if pixels are small, only every second pixel, for example, has a point.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from functools import cached_property
from itertools import product

import numpy as np
import numpy.typing as npt

from robochoc.maps.occupancy.clearance import quadruple_squares
from robochoc.maps.routes.distances import Array, Flags, norms

_LENGTHS = (15, 21, 26)
"""The lengths of steps along one axis, two and three."""
_WIDE, _NARROW = 4, 5
"""The factors for steps to points far from walls, and near walls."""
_TOGETHER = _WIDE * _LENGTHS[0]
_LIMIT = 2**30
"""The length assigned to points without a route."""
_GATES = 4
"""The number of lattice points that are tried as the first, or the last, point of a route."""

Numbers = npt.NDArray[np.int64]
Lengths = npt.NDArray[np.int32]


class Lattice:
    """Finds routes on a lattice over pixels or voxels. Lengths are in pixels; x is first in places, and last in arrays.

    Args:
        solid: The pixels or voxels that are not free.
        keep: The distance of all lines between neighbours from solid pixels, and from the outside.
        spare: The additional distance at which a point is far from walls.
        parts: The number of points along the side of a pixel.
        every: The interval between used points: 2 uses every second point.
    """

    def __init__(self, solid: Flags, keep: float, spare: float, parts: int, every: int = 1) -> None:
        self._keep = keep
        self._begin = min(every // 2, min(solid.shape) * parts - 1)
        self._side = every / parts
        self._offset = (self._begin + 0.5) / parts
        # Half way between two neighbours, only a single corner of a wall may be nearer than at both ends.
        bulge = solid.ndim * every * every / 4
        squares = [((keep + more) * parts) ** 2 + bulge for more in (0.0, spare)]
        apart = quadruple_squares(solid, parts, math.ceil(math.sqrt(squares[1])) + 1)
        apart = apart[(slice(self._begin, None, every),) * solid.ndim]
        self._free = np.pad(apart >= 4 * squares[0], 1)
        wide = np.pad(apart >= 4 * squares[1], 1)
        self._weights = np.where(wide, _WIDE, _NARROW).astype(np.int8).ravel()

    def path(
        self, start: Array, goal: Array, sees: Callable[[Array, Array], bool], without: Numbers | None = None
    ) -> tuple[Array, Flags] | None:
        """Return the points on a shortest route from near `start` to near `goal`, and whether each is far from walls.

        The first point is visible from `start`, and the last from `goal`. The points `without` are excluded. None is
        returned if there is no route.
        """
        free = self._without(without)
        firsts, lasts = [*self._gates(start, sees, free)], [*self._gates(goal, sees, free)]
        if not (firsts and lasts):
            return None
        lengths = self._search(free, firsts, lasts[0])
        reached = [last for last in lasts if lengths[last] < _LIMIT]  # there may be no route to the first of `lasts`
        if not reached:
            return None
        numbers = self._traced(lengths, free, reached[0])
        return self._places(numbers), self._weights[numbers] == _WIDE

    def reached(self, start: Array, sees: Callable[[Array, Array], bool], without: Numbers, most: float) -> Array:
        """Return the points (K, D) that can be reached by a route of at most `most`, the nearest first."""
        free = self._without(without)
        firsts = [*self._gates(start, sees, free)]
        if not firsts:
            return np.empty((0, self._free.ndim))
        longest = min(most / self._side * _WIDE * _LENGTHS[0], _LIMIT)
        lengths = self._search(free, firsts, None, math.ceil(longest))
        found = np.flatnonzero(lengths < _LIMIT)
        return self._places(found[np.argsort(lengths[found], kind="stable")])

    def around(self, place: Array, radii: Array) -> Numbers:
        """Return the points in an ellipsoid around a place, with semi-axes a little larger than `radii`.

        Lines between neighbours among all other points do not pass through the ellipsoid with the given radii.
        """
        least = float(radii.min())
        radii = radii * math.sqrt(1 + self._free.ndim * self._side**2 / (4 * least * least))
        low, high = (np.floor((place + side * radii - self._offset) / self._side).astype(int) + 1 for side in (-1, 1))
        axes = [
            np.arange(max(first, 1), min(last + 2, size - 1))
            for first, last, size in zip(low, high, reversed(self._free.shape), strict=True)
        ]
        if not all(map(len, axes)):
            return np.empty(0, dtype=np.int64)
        numbers: Numbers = np.ravel_multi_index(np.ix_(*reversed(axes)), self._free.shape).ravel()
        found: Numbers = numbers[np.square((self._places(numbers) - place) / radii).sum(axis=1) < 1]
        return found

    def _without(self, numbers: Numbers | None) -> Flags:
        free = self._free.ravel()
        if numbers is not None:
            free = free.copy()
            free[numbers] = False
        return free

    def _places(self, numbers: Numbers) -> Array:
        at = np.column_stack(np.unravel_index(numbers, self._free.shape)[::-1])
        return np.asarray((at - 1) * self._side + self._offset)

    def _gates(self, place: Array, sees: Callable[[Array, Array], bool], free: Flags) -> Iterator[int]:
        """Yield the nearest points of the lattice that are visible from a place."""
        reach = math.ceil(self._keep / self._side) + 3
        at = np.floor((place[::-1] - self._offset) / self._side + 0.5).astype(int) + 1
        low = np.maximum(at - reach, 0)
        window = tuple(slice(first, last) for first, last in zip(low, np.maximum(at + reach + 1, 0), strict=True))
        found = np.argwhere(free.reshape(self._free.shape)[window]) + low
        numbers = np.ravel_multi_index(tuple(found.T), self._free.shape)
        places = self._places(numbers)
        count = 0
        for number in np.argsort(norms(places - place), kind="stable").tolist():
            if sees(place, places[number]):
                yield int(numbers[number])
                count += 1
                if count == _GATES:
                    return

    def _search(self, free: Flags, firsts: list[int], last: int | None, most: int = _LIMIT) -> Lengths:
        """Return the lengths of shortest routes from any of `firsts`; `_LIMIT` for points without a known route.

        The search ends when the route to `last` is known. If `last` is None or unreachable, all points with routes no
        longer than `most` are found.
        """
        lengths = np.full(free.size, _LIMIT, dtype=np.int32)
        waiting: dict[int, list[Numbers]] = {}
        heap: list[int] = []

        def wait(points: Numbers) -> None:
            rounds = (lengths[points] + self._least(points, last)) // _TOGETHER
            for later in np.unique(rounds).tolist():
                if later not in waiting:
                    waiting[later] = []
                    heapq.heappush(heap, later)
                waiting[later].append(points[rounds == later])

        begins = np.array(firsts)
        lengths[begins] = 0
        wait(begins)
        while heap:
            this = heapq.heappop(heap)
            if last is not None and lengths[last] <= this * _TOGETHER:
                break
            points = np.unique(np.concatenate(waiting.pop(this)))
            points = points[(lengths[points] + self._least(points, last)) // _TOGETHER == this]
            fresh = []
            for step, beside, length in self._steps:
                ends = points + step
                further = lengths[points] + length * self._weights[ends].astype(np.int32)
                new = free[ends] & (further < lengths[ends]) & (further <= most)
                for side in beside:
                    new &= free[points + side]
                ends = ends[new]
                lengths[ends] = further[new]
                fresh.append(ends)
            if (new_points := np.unique(np.concatenate(fresh))).size:
                wait(new_points)
        return lengths

    def _least(self, points: Numbers, last: int | None) -> Lengths:
        """Return the lengths that the routes from `points` to `last` would have without walls."""
        if last is None:
            return np.zeros(len(points), dtype=np.int32)
        ends = np.unravel_index(last, self._free.shape)
        ways = zip(np.unravel_index(points, self._free.shape), ends, strict=True)
        apart = np.sort([np.abs(at - end) for at, end in ways], axis=0)[::-1]  # the longest axis first
        steps = apart - np.concatenate((apart[1:], np.zeros_like(apart[:1])))
        found: Lengths = (_WIDE * np.array(_LENGTHS[: len(steps)]) @ steps).astype(np.int32)
        return found

    def _traced(self, lengths: Lengths, free: Flags, last: int) -> Numbers:
        found = [last]
        while lengths[found[-1]]:
            here = found[-1]
            weight = int(self._weights[here])
            # A step is possible in both directions or in none, since it cuts no corner.
            before = next(
                here + step
                for step, beside, length in self._steps
                if lengths[here + step] + length * weight <= lengths[here]
                and free[here + step]
                and all(free[here + side] for side in beside)
            )
            found.append(before)
        return np.array(found[::-1])

    @cached_property
    def _steps(self) -> list[tuple[int, tuple[int, ...], int]]:
        """All steps in the flat array, with the offsets of points beside the step, and its length; shortest first."""
        shape = self._free.shape
        strides = [int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))]
        found = []
        for moves in product((0, 1, -1), repeat=len(shape)):
            parts = [move * stride for move, stride in zip(moves, strides, strict=True) if move]
            if parts:
                some = [sum(chosen) for chosen in product(*((0, part) for part in parts))]
                found.append((some[-1], tuple(some[1:-1]), _LENGTHS[len(parts) - 1]))
        return sorted(found, key=lambda step: step[2])
