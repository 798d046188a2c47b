"""Paths of a drone between resting drones: polylines that keep the distance from all these drones.

Candidates, in order of preference:

1. a straight line;
2. `by_lane`: up or down to the height of a lane, across, and up or down. The lane with the shortest detour is used, the
   lowest of equal lanes;
3. `around`: by lane via a column beside the start or the goal, for a drone with another drone directly above;
4. `over_all`: up to the `sky`, via a column beside the start if necessary, across, and down in the same way. The sky is
   a height that is clear of all points at rest.

Blocked heights are computed, not searched for. On a vertical line, or among all horizontal lines between two columns, a
point blocks an interval of heights. Half of its length is sqrt(distance^2 - r^2), where r is the point's distance in
the plane. So `by_lane` finds a lane whenever there is one.

With a floor plan (`maps/routes/floor_plan.py`), "across" is not a straight line, but a route around the walls at
constant height.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from robochoc.flight.coordination.spacing import Spacing
from robochoc.maps.routes.distances import SLACK_M, Array, Flags, norms, segment_distances
from robochoc.maps.routes.floor_plan import FloorPlan
from robochoc.system.lazy_dataclass import dataclass

Column = Array
"""The x and y coordinates of a vertical line."""

_DIRECTIONS = 8
"""The number of directions of the columns around a point."""
_RADII = (1.0, math.sqrt(2), 2.0, 3.0)
"""The radii of these columns around the point, as multiples of the distance."""


@dataclass(frozen=True)
class OutdoorSpace(Spacing):
    """Finds paths at least `distance` from points at rest, and not below `ground`. `sky` is above all points.

    With `rises`, drones take off and land vertically where possible. Paths do not cross walls of the `floor_plan` at
    any height.
    """

    ground: float
    sky: float
    rises: bool = False
    floor_plan: FloorPlan | None = None

    @property
    def off_ground(self) -> float:
        """The minimum height at which a drone is off the ground."""
        return self.ground + self.distance / 4

    def slides(self, starts: Array, goals: Array) -> Flags:
        """Return which straight lines (K,) lead along the ground or, with `rises`, diagonally from or to the ground."""
        low = (np.minimum if self.rises else np.maximum)(starts[:, 2], goals[:, 2]) < self.off_ground
        flags: Flags = low & (starts[:, :2] != goals[:, :2]).any(axis=1)
        return flags

    def is_walled(self, starts: Array, goals: Array) -> Flags:
        """Return which straight lines (K,) lead through walls."""
        if self.floor_plan is None:
            return np.zeros(len(starts), dtype=bool)
        return ~self.floor_plan.are_clear(starts, goals)

    def across(
        self, start: Array, goal: Array, first: Column | None = None, last: Column | None = None
    ) -> Array | None:
        """Return the columns (K + 1, 2) of a route from `start` to `goal` in the plane; None if there is no route.

        The route begins in the column `first` and ends in `last`; by default, in the columns of `start` and `goal`.
        """
        first, last = start[:2] if first is None else first, goal[:2] if last is None else last
        if self.floor_plan is None:
            return np.array([first, last])
        way = self.floor_plan.route(start, goal)
        if way is None:
            return None
        ends = ([first] if (first != way[0]).any() else [], [last] if (last != way[-1]).any() else [])
        columns = [*ends[0], *way, *ends[1]]
        # From a column beside the start, or to one beside the goal, a corner may be left out.
        for at, beside in ((1, ends[0]), (len(columns) - 2, ends[1])):
            if beside and 0 < at < len(columns) - 1 and self._is_open(columns[at - 1], columns[at + 1]):
                del columns[at]
        return np.array(columns)

    def _is_open(self, first: Column, second: Column) -> bool:
        return self.floor_plan is None or bool(self.floor_plan.are_clear(first[None], second[None])[0])

    def by_lane(self, start: Array, goal: Array, points: Array) -> Array | None:
        """Return the path by the best lane (up or down, across, up or down); None if no lane is clear of `points`."""
        return next(self.lanes(start, goal, points), None)

    def lanes(self, start: Array, goal: Array, points: Array) -> Iterator[Array]:
        """Yield paths by several lanes, the best first. Lanes are at least a distance apart."""
        columns = self.across(start, goal)
        if columns is None:
            return
        least, most = self._reach(start, points)
        lowest, highest = self._reach(goal, points)
        floor = min(self.ground + self.distance, max(start[2], goal[2]))
        if self.slides(start[None], goal[None])[0]:
            floor = max([self.ground + self.distance, *((start[2], goal[2]) if self.rises else ())])
        low, high = max(least, lowest, floor), min(most, highest, self.sky)
        heights = _outside(self._spans(columns, points), low, high, (start[2], goal[2]))
        lower, upper = sorted((float(start[2]), float(goal[2])))
        taken: list[float] = []
        for height in sorted(heights, key=lambda h: (round(max(lower - h, h - upper, 0.0), 9), h)):
            if all(abs(height - other) >= self.least for other in taken):
                path = _path(start, *((column, height) for column in columns), goal)
                if self.is_clear(path, points):
                    taken.append(height)
                    yield path

    def around(self, start: Array, goal: Array, points: Array) -> Array | None:
        """Return the path via the best column beside the start or the goal; None if there is no such path."""
        best, path = math.inf, None
        reach, limits = self._reach(start, points), self._reach(goal, points)
        for column, there, here in self._ways_round(start, goal):
            outs = self._exits(start, there, points, reach)
            backs = self._exits(goal, here[::-1], points, limits) if outs else []
            spans = self._spans(column[None], points)
            for out, back in product(outs, backs):
                length = abs(out - start[2]) + abs(out - back) + abs(back - goal[2])
                length += float(norms(np.diff(there, axis=0)).sum() + norms(np.diff(here, axis=0)).sum())
                if length < best and not _is_spanned(spans, out, back):
                    bends = (*((one, out) for one in there), *((one, back) for one in here))
                    tried = _path(start, *bends, goal)
                    if self.is_clear(tried, points):
                        best, path = length, tried
        return path

    def over_all(self, start: Array, goal: Array, points: Array) -> Array | None:
        """Return the path via the sky; None if the sky is not clear between the columns."""
        up, down = self.path_up(start, points), self.path_up(goal, points)
        if up is None or down is None:
            return None
        columns = self.across(start, goal, up[-1, :2], down[-1, :2])
        if columns is None:
            return None
        between = np.column_stack((columns[1:-1], np.full(len(columns) - 2, self.sky)))
        path = _joined(np.vstack((up, between, down[::-1])))
        return path if self.is_clear(path, points) else None

    def path_up(self, start: Array, points: Array) -> Array | None:
        """Return the path from `start` to the sky, straight up if possible."""
        path = _path(start, (start[:2], self.sky))
        if self.is_clear(path, points):
            return path
        best, found = math.inf, None
        reach = self._reach(start, points)
        for column in self._beside(start):
            spans = self._spans(column[None], points)
            for out in self._exits(start, np.array([start[:2], column]), points, reach):
                length = abs(out - start[2]) + float(norms(column - start[:2]))
                if length < best and not _is_spanned(spans, out, self.sky):
                    tried = _path(start, (start[:2], out), (column, out), (column, self.sky))
                    if self.is_clear(tried, points):
                        best, found = length, tried
        return found

    def _ways_round(self, start: Array, goal: Array) -> Iterator[tuple[Column, Array, Array]]:
        """Yield each column beside the start or the goal, with the columns of the routes to it and from it."""
        for column in self._beside(start):
            here = self.across(start, goal, first=column)
            if here is not None:
                yield column, np.array([start[:2], column]), here
        for column in self._beside(goal):
            there = self.across(start, goal, last=column)
            if there is not None:
                yield column, there, np.array([column, goal[:2]])

    def _beside(self, point: Array) -> Iterator[Column]:
        for radius, step in product(_RADII, range(_DIRECTIONS)):
            angle = 2 * math.pi * step / _DIRECTIONS
            column = point[:2] + (self.distance * radius) * np.array([math.cos(angle), math.sin(angle)])
            if self._is_open(point[:2], column):
                yield column

    def _exits(self, start: Array, columns: Array, points: Array, reach: tuple[float, float]) -> list[float]:
        """Return the heights at which a drone can leave by `columns`: the ends of clear intervals.

        Heights at the ground are returned only if there are no others.
        """
        low, high = max(reach[0], min(self.ground, float(start[2]))), min(reach[1], self.sky)
        found = _outside(self._spans(columns, points), low, high, (start[2], self.off_ground))
        return [height for height in found if height >= self.off_ground] or found

    def _reach(self, start: Array, points: Array) -> tuple[float, float]:
        """Return the lowest and the highest height that can be reached vertically from `start`."""
        spans = self._spans(start[None, :2], points)
        above = spans.mean(axis=1) > start[2]
        low = spans[~above, 1].max(initial=-math.inf)
        high = spans[above, 0].min(initial=math.inf)
        return min(float(low), float(start[2])), max(float(high), float(start[2]))

    def _spans(self, columns: Array, points: Array) -> Array:
        """Return the intervals of heights (W, 2) in which points block the route by `columns`, or a single column.

        For a route with several pieces, each point has one interval: that for the piece nearest to the point.
        """
        first, second = (columns[:-1], columns[1:]) if len(columns) > 1 else (columns, columns)
        radius = segment_distances(first, second, points[:, :2]).min(axis=0)
        # A little less strict than `is_clear`, which makes the final decision, in spite of rounding.
        least = self.distance - SLACK_M / 2
        close = radius < least
        half = np.sqrt(least * least - radius[close] ** 2)
        heights = points[close, 2]
        return np.column_stack((heights - half, heights + half))


def _outside(spans: Array, low: float, high: float, wished: tuple[float, ...]) -> list[float]:
    """Return the ends of the free intervals between `low` and `high`, outside `spans`, and `wished` heights in them."""
    heights = np.concatenate((spans.ravel(), [low, high], wished))
    heights = np.unique(heights[(low <= heights) & (heights <= high)])
    free = ~((spans[None, :, 0] < heights[:, None]) & (heights[:, None] < spans[None, :, 1])).any(axis=1)
    found: list[float] = heights[free].tolist()
    return found


def _is_spanned(spans: Array, first: float, second: float) -> bool:
    low, high = min(first, second), max(first, second)
    return bool(((spans[:, 0] < high) & (low < spans[:, 1])).any())


def _path(start: Array, *bends: tuple[Column, float] | Array) -> Array:
    corners = [(*bend[0], bend[1]) if isinstance(bend, tuple) else bend for bend in bends]
    return _joined(np.array([start, *corners], dtype=float))


def _joined(corners: Array) -> Array:
    """Return a path without pieces of length 0, and without unnecessary corners on a vertical line."""
    stays = (corners[1:] == corners[:-1]).all(axis=1)
    corners = corners[np.concatenate(([True], ~stays))]
    if len(corners) < 3:  # noqa: PLR2004 - a corner is between two pieces
        return corners
    upright = (corners[1:, :2] == corners[:-1, :2]).all(axis=1)
    rises = corners[1:, 2] > corners[:-1, 2]
    smooth = upright[1:] & upright[:-1] & (rises[1:] == rises[:-1])
    return corners[np.concatenate(([True], ~smooth, [True]))]
