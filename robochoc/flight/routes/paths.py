"""Paths of a drone between others that rest: polylines that keep the distance from all of them.

Candidates, in order of preference:

1. `straight`;
2. `by_lane`: up or down to a lane's height, across, and up or down. The lane with the shortest detour is taken, and of
   equal ones the lowest;
3. `round`: the same by way of a column beside the start or the goal, for drones with another one right above;
4. over everything: from the start up to the `sky`, by way of a column beside it where that is needed, across, and
   down in the same manner. The sky is a height that is clear of all points at rest.

What a point blocks is computed, not searched for. Of a vertical line, or of all horizontal lines between two columns,
it blocks an interval of heights. Half of the interval is sqrt(distance^2 - r^2), where r is the distance of the point
in the plane. So `by_lane` finds a lane whenever there is one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from robochoc.flight.routes.spacing import SLACK_M, Array, Flags, norms, segment_distances

Column = Array
"""The x and the y of a vertical line."""

_DIRECTIONS = 8
"""Directions of the columns around a point."""
_RADII = (1.0, math.sqrt(2), 2.0, 3.0)
"""Distances of these columns, in distances."""


@dataclass(frozen=True)
class Space:
    """The space for paths: at least `distance` from points at rest, not below `ground`. `sky` is above all points.

    With `rises`, drones leave the ground, and land, straight up and down where they can.
    """

    distance: float
    ground: float
    sky: float
    rises: bool = False

    @property
    def least(self) -> float:
        """The distance, less rounding."""
        return self.distance - SLACK_M

    @property
    def off(self) -> float:
        """The height from which on a drone is off the ground."""
        return self.ground + self.distance / 4

    def near(self, origins: Array, ends: Array, points: Array) -> Flags:
        """Return whether (K, P) straight lines come too near to `points` (P, 3)."""
        return segment_distances(origins, ends, points) < self.least

    def is_clear(self, path: Array, points: Array) -> bool:
        """Return whether a path keeps the distance from `points`."""
        return not self.near(path[:-1], path[1:], points).any()

    def slides(self, starts: Array, goals: Array) -> Flags:
        """Return which straight lines (K,) lead along the ground; or, with `rises`, aslant from it or to it."""
        low = (np.minimum if self.rises else np.maximum)(starts[:, 2], goals[:, 2]) < self.off
        flags: Flags = low & (starts[:, :2] != goals[:, :2]).any(axis=1)
        return flags

    def by_lane(self, start: Array, goal: Array, points: Array) -> Array | None:
        """Return the path up or down to the best lane, across, and up or down; None if no lane is clear of `points`."""
        return next(self.lanes(start, goal, points), None)

    def lanes(self, start: Array, goal: Array, points: Array) -> Iterator[Array]:
        """Yield the paths by several lanes, a distance or more from each other, the best first."""
        least, most = self._reach(start, points)
        lowest, highest = self._reach(goal, points)
        floor = min(self.ground + self.distance, max(start[2], goal[2]))
        if self.slides(start[None], goal[None])[0]:
            floor = max([self.ground + self.distance, *((start[2], goal[2]) if self.rises else ())])
        low, high = max(least, lowest, floor), min(most, highest, self.sky)
        heights = _outside(self._walls(start[:2], goal[:2], points), low, high, (start[2], goal[2]))
        lower, upper = sorted((float(start[2]), float(goal[2])))
        taken: list[float] = []
        for height in sorted(heights, key=lambda h: (round(max(lower - h, h - upper, 0.0), 9), h)):
            if all(abs(height - other) >= self.least for other in taken):
                path = _path(start, (start[:2], height), (goal[:2], height), goal)
                if self.is_clear(path, points):
                    taken.append(height)
                    yield path

    def round(self, start: Array, goal: Array, points: Array) -> Array | None:
        """Return the path by way of the best column beside the start or the goal; None if there is none."""
        best, path = math.inf, None
        reach, limits = self._reach(start, points), self._reach(goal, points)
        for column in (*self._beside(start), *self._beside(goal)):
            outs = self._exits(start, column, points, reach)
            backs = self._exits(goal, column, points, limits) if outs else []
            walls = self._walls(column, column, points)
            for out, back in product(outs, backs):
                length = abs(out - start[2]) + abs(out - back) + abs(back - goal[2])
                length += float(norms(column - start[:2]) + norms(column - goal[:2]))
                if length < best and not _is_walled(walls, out, back):
                    there, here = (start[:2], out), (goal[:2], back)
                    tried = _path(start, there, (column, out), (column, back), here, goal)
                    if self.is_clear(tried, points):
                        best, path = length, tried
        return path

    def over(self, start: Array, goal: Array, points: Array) -> Array | None:
        """Return the path by way of the sky; None if the sky is not clear between the columns."""
        up, down = self.up(start, points), self.up(goal, points)
        if up is None or down is None:
            return None
        path = _joined(np.vstack((up, down[::-1])))
        return path if self.is_clear(path, points) else None

    def up(self, start: Array, points: Array) -> Array | None:
        """Return the path from `start` to the sky, straight up if possible."""
        path = _path(start, (start[:2], self.sky))
        if self.is_clear(path, points):
            return path
        best, found = math.inf, None
        reach = self._reach(start, points)
        for column in self._beside(start):
            walls = self._walls(column, column, points)
            for out in self._exits(start, column, points, reach):
                length = abs(out - start[2]) + float(norms(column - start[:2]))
                if length < best and not _is_walled(walls, out, self.sky):
                    tried = _path(start, (start[:2], out), (column, out), (column, self.sky))
                    if self.is_clear(tried, points):
                        best, found = length, tried
        return found

    def _beside(self, point: Array) -> Iterator[Column]:
        for radius, step in product(_RADII, range(_DIRECTIONS)):
            angle = 2 * math.pi * step / _DIRECTIONS
            yield point[:2] + (self.distance * radius) * np.array([math.cos(angle), math.sin(angle)])

    def _exits(self, start: Array, column: Column, points: Array, reach: tuple[float, float]) -> list[float]:
        """Return the heights at which a drone can leave for a column: those where clear intervals begin and end.

        Heights along the ground count only if there are no others.
        """
        low, high = max(reach[0], min(self.ground, float(start[2]))), min(reach[1], self.sky)
        found = _outside(self._walls(start[:2], column, points), low, high, (start[2], self.off))
        return [height for height in found if height >= self.off] or found

    def _reach(self, start: Array, points: Array) -> tuple[float, float]:
        """Return the lowest and the highest height that can be reached straight from `start`."""
        walls = self._walls(start[:2], start[:2], points)
        above = walls.mean(axis=1) > start[2]
        low = walls[~above, 1].max(initial=-math.inf)
        high = walls[above, 0].min(initial=math.inf)
        return min(float(low), float(start[2])), max(float(high), float(start[2]))

    def _walls(self, first: Column, second: Column, points: Array) -> Array:
        """Return the intervals of heights (W, 2) in which points block the way across between two columns."""
        radius = segment_distances(first[None], second[None], points[:, :2])[0]
        # A little less strict than `is_clear` is, which has the last word: rounding must not make them disagree.
        least = self.distance - SLACK_M / 2
        close = radius < least
        half = np.sqrt(least * least - radius[close] ** 2)
        heights = points[close, 2]
        return np.column_stack((heights - half, heights + half))


def _outside(walls: Array, low: float, high: float, wished: tuple[float, ...]) -> list[float]:
    """Return the ends of what is left of `low` to `high` without `walls`, and those of `wished` that are left."""
    heights = np.concatenate((walls.ravel(), [low, high], wished))
    heights = np.unique(heights[(low <= heights) & (heights <= high)])
    free = ~((walls[None, :, 0] < heights[:, None]) & (heights[:, None] < walls[None, :, 1])).any(axis=1)
    found: list[float] = heights[free].tolist()
    return found


def _is_walled(walls: Array, first: float, second: float) -> bool:
    low, high = min(first, second), max(first, second)
    return bool(((walls[:, 0] < high) & (low < walls[:, 1])).any())


def _path(start: Array, *bends: tuple[Column, float] | Array) -> Array:
    corners = [(*bend[0], bend[1]) if isinstance(bend, tuple) else bend for bend in bends]
    return _joined(np.array([start, *corners], dtype=float))


def _joined(corners: Array) -> Array:
    """Return a path without pieces of no length, and without needless corners on a vertical line."""
    stays = (corners[1:] == corners[:-1]).all(axis=1)
    corners = corners[np.concatenate(([True], ~stays))]
    if len(corners) < 3:  # noqa: PLR2004 - a corner is between two pieces
        return corners
    upright = (corners[1:, :2] == corners[:-1, :2]).all(axis=1)
    rises = corners[1:, 2] > corners[:-1, 2]
    smooth = upright[1:] & upright[:-1] & (rises[1:] == rises[:-1])
    return corners[np.concatenate(([True], ~smooth, [True]))]
