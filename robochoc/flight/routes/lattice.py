"""Shortest ways on a lattice of points that are far enough from all walls.

A* (Hart, Nilsson, Raphael 1968) on the points with eight neighbours, in integers: steps of 5 and 7 as in the travel
times of generated teams (`generators/maps/travel.py`), four times as long where walls are far, five times where they
are near. All points of one estimate are looked at together.

Points are the centres of pixels; where pixels are large for a drone, those of parts of pixels.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from robochoc.flight.routes.spacing import Array, Flags, norms

_STRAIGHT, _DIAGONAL = 5, 7
_WIDE, _NARROW = 4, 5
"""By what steps are multiplied to a point where walls are far, and where they are near."""
_FINE = 4
"""Points of the lattice in the distance that drones keep from walls, at least."""
_FINE_M = 0.02
"""Points are never closer to each other, whatever drones keep."""
_POINTS_MAX = 4_000_000
_GATES = 4
"""Points of the lattice that are tried as the first, or the last, of a way."""

Numbers = npt.NDArray[np.int64]


class Lattice:
    """A lattice over pixels. Lengths are in sides of a pixel, of which one is `size_m` metres.

    Args:
        solid: The pixels that are not free.
        keep: The distance from solid pixels, and from the outside, that all lines between neighbours keep.
        spare: Where walls are further away than that, too, they are far.
        size_m: The side of a pixel in metres.
    """

    def __init__(self, solid: Flags, keep: float, spare: float, size_m: float) -> None:
        finest = max(1, int(size_m / _FINE_M), 1)
        parts = min(max(1, math.ceil(_FINE / keep)) if keep > 0 else 1, finest)
        while parts > 1 and solid.size * parts * parts > _POINTS_MAX:
            parts -= 1
        self._parts = parts
        self._keep = keep
        fine = np.repeat(np.repeat(solid, parts, axis=0), parts, axis=1)
        # Half way between two neighbours walls may be nearer than at both: by no more than that of a single corner.
        self._free = np.pad(_away(fine, math.sqrt((keep * parts) ** 2 + 0.5)), 1)
        wide = np.pad(_away(fine, math.sqrt(((keep + spare) * parts) ** 2 + 0.5)), 1)
        self._weights = np.where(wide, _WIDE, _NARROW).astype(np.int64).ravel()
        self._width = self._free.shape[1]

    def path(self, start: Array, goal: Array, sees: Callable[[Array, Array], bool]) -> tuple[Array, Flags] | None:
        """Return the points of a shortest way from near `start` to near `goal`, and at which of them walls are far.

        The first point and `start` see each other, as do the last and `goal`. None: there is no way.
        """
        firsts, lasts = [*self._gates(start, sees)], [*self._gates(goal, sees)]
        if not (firsts and lasts):
            return None
        lengths, done = self._search(firsts, lasts[0])
        reached = [last for last in lasts if done[last]]  # all to which there is a way, where it is not the first one
        if not reached:
            return None
        numbers = self._traced(lengths, done, reached[0])
        return self._places(numbers), self._weights[numbers] == _WIDE

    def _places(self, numbers: Numbers) -> Array:
        rows, columns = np.divmod(numbers, self._width)
        return (np.column_stack((columns, rows)) - 0.5) / self._parts

    def _gates(self, place: Array, sees: Callable[[Array, Array], bool]) -> Iterator[int]:
        """Yield the nearest points of the lattice that see a place."""
        rows, columns = self._free.shape
        reach = math.ceil(self._keep * self._parts) + 3
        column, row = (math.floor(part * self._parts) + 1 for part in place)
        low, left = max(row - reach, 0), max(column - reach, 0)
        near = self._free[low : min(row + reach + 1, rows), left : min(column + reach + 1, columns)]
        found = np.argwhere(near)
        numbers = (found[:, 0] + low) * self._width + found[:, 1] + left
        places = self._places(numbers)
        count = 0
        for at in np.argsort(norms(places - place), kind="stable").tolist():
            if sees(place, places[at]):
                yield int(numbers[at])
                count += 1
                if count == _GATES:
                    return

    def _search(self, firsts: list[int], last: int) -> tuple[Numbers, Flags]:
        """Return the lengths of shortest ways from one of `firsts`, and the points for which they are known.

        `last` is one of these; if no way leads there, they are all points to which one leads.
        """
        free = self._free.ravel()
        steps = _steps(self._width)
        limit = np.iinfo(np.int64).max // 2
        lengths = np.full(free.size, limit, dtype=np.int64)
        done = np.zeros(free.size, dtype=bool)
        begins = np.array(firsts)
        lengths[begins] = 0
        waiting: dict[int, list[Numbers]] = {}
        heap: list[int] = []

        def wait(points: Numbers) -> None:
            estimates = lengths[points] + self._least(points, last)
            for estimate in np.unique(estimates).tolist():
                if estimate not in waiting:
                    waiting[estimate] = []
                    heapq.heappush(heap, estimate)
                waiting[estimate].append(points[estimates == estimate])

        wait(begins)
        while heap and not done[last]:
            estimate = heapq.heappop(heap)
            points = np.unique(np.concatenate(waiting.pop(estimate)))
            points = points[~done[points]]
            done[points] = True
            fresh = []
            for step, beside, length in steps:
                ends = points + step
                new = free[ends] & ~done[ends]
                for side in beside:
                    new &= free[points + side]
                ends, further = ends[new], lengths[points[new]] + length * self._weights[ends[new]]
                shorter = further < lengths[ends]
                ends = ends[shorter]
                lengths[ends] = further[shorter]
                fresh.append(ends)
            if (new_points := np.unique(np.concatenate(fresh))).size:
                wait(new_points)
        return lengths, done

    def _least(self, points: Numbers, last: int) -> Numbers:
        """Return the length of the way to `last` that there would be without walls."""
        rows, columns = np.divmod(points, self._width)
        row, column = divmod(last, self._width)
        up, right = np.abs(rows - row), np.abs(columns - column)
        across = np.minimum(up, right)
        found: Numbers = _WIDE * (_STRAIGHT * (np.maximum(up, right) - across) + _DIAGONAL * across)
        return found

    def _traced(self, lengths: Numbers, done: Flags, last: int) -> Numbers:
        free, steps = self._free.ravel(), _steps(self._width)
        found = [last]
        while lengths[found[-1]]:
            here = found[-1]
            weight = int(self._weights[here])
            # A step is the same both ways: it cuts no corner.
            before = next(
                here + step
                for step, beside, length in steps
                if done[here + step]
                and lengths[here + step] + length * weight == lengths[here]
                and all(free[here + side] for side in beside)
            )
            found.append(before)
        return np.array(found[::-1])


def _steps(width: int) -> list[tuple[int, tuple[int, ...], int]]:
    """Return the eight steps in a flat array of rows so wide, with the points beside a diagonal, and the length."""
    straight = [(step, (), _STRAIGHT) for step in (1, -1, width, -width)]
    return [*straight, *((up + side, (up, side), _DIAGONAL) for up in (width, -width) for side in (1, -1))]


def _away(solid: Flags, distance: float) -> Flags:
    """Return the pixels whose centres are at least `distance`, in pixels, from all solid ones and from the outside.

    Distances are to the borders of solid pixels.
    """
    rows, columns = solid.shape
    reach = math.ceil(distance + 0.5)
    padded = np.pad(solid, reach, constant_values=True)
    near = np.zeros_like(solid)
    for step in range(-reach, reach + 1):
        left = distance * distance - max(abs(step) - 0.5, 0) ** 2
        if left <= 0:
            continue
        half = math.ceil(math.sqrt(left) + 0.5) - 1
        line = padded[reach + step : reach + step + rows]
        sums = np.cumsum(np.pad(line, ((0, 0), (1, 0))), axis=1, dtype=np.int32)
        first = reach - half
        near |= sums[:, first + 2 * half + 1 : first + 2 * half + 1 + columns] > sums[:, first : first + columns]
    return ~near
