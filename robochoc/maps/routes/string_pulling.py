"""String pulling: replaces the many points of a route by a few straight pieces that are clear of walls.

Each corner is penalized by an extra length, since drones come to rest there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from robochoc.maps.routes.distances import Array, norms

Sees = Callable[[Array, Array, float], bool]
"""Returns whether a straight line between two points keeps a distance from all walls."""
_Numbered = Callable[[int, int], bool]

_AROUND = (-16, -8, -4, -2, -1, 0, 1, 2, 4, 8, 16)
"""The offsets, along the route, of points that may replace a corner."""
_LOOK_BACK = 60
_ROUNDS = 2
_HALVINGS = 6


def taut(points: Array, keeps: Array, sees: Sees, corner: float) -> Array:
    """Return the corners of a short route along `points` (K, D), from the first to the last one.

    Args:
        points: The points; the lines between consecutive points keep the smallest of `keeps`.
        keeps: The distance from walls at each point (K,). A piece keeps the smallest distance of its points.
        sees: Returns whether a line keeps a distance.
        corner: The extra length by which a corner is penalized.
    """
    least = float(keeps.min())

    def seen(i: int, j: int) -> bool:
        return sees(points[i], points[j], float(keeps[i : j + 1].min()) if j > i + 1 else least)

    chain = _far_sighted(len(points) - 1, seen)
    chosen = _shortest(points, chain, seen, corner)
    bends = [points[number] for number in chosen]
    kept = [float(keeps[i : j + 1].min()) for i, j in pairwise(chosen)]
    for _ in range(_ROUNDS):
        for at in range(1, len(bends) - 1):
            keep = min(kept[at - 1], kept[at])
            bends[at] = _nearer(bends[at - 1], bends[at], bends[at + 1], keep, sees)
    return np.array(bends)


def _nearer(before: Array, bend: Array, after: Array, keep: float, sees: Sees) -> Array:
    """Return `bend`, moved towards the straight line between its neighbours as far as walls allow."""
    along = after - before
    squared = float(along @ along)
    share = min(max(float((bend - before) @ along) / squared, 0.0), 1.0) if squared else 0.0
    target = before + share * along
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        tried = bend + middle * (target - bend)
        clear = sees(before, tried, keep) and sees(tried, after, keep)
        low, high = (middle, high) if clear else (low, middle)
    return np.asarray(bend + low * (target - bend))


def _far_sighted(last: int, sees: _Numbered) -> list[int]:
    """Return points from 0 to `last`, each visible from the previous point, and about as far from it as possible."""
    chain = [0]
    while (here := chain[-1]) < last:
        good, bad = here + 1, last + 1
        step = 2
        while here + step <= last and sees(here, here + step):
            good = here + step
            step *= 2
        bad = min(bad, here + step)
        while bad - good > 1:
            middle = (good + bad) // 2
            good, bad = (middle, bad) if sees(here, middle) else (good, middle)
        chain.append(good)
    return chain


def _shortest(points: Array, chain: Sequence[int], sees: _Numbered, corner: float) -> list[int]:
    """Return the corners of the shortest route over points in `chain` and near them, with `corner` as penalty."""
    last = chain[-1]
    links = set(pairwise(chain))
    numbers = sorted({*chain, *(at + by for at in chain[1:-1] for by in _AROUND if 0 < at + by < last)})
    costs = {0: 0.0}
    origin: dict[int, int] = {}
    for place, number in enumerate(numbers[1:], 1):
        before = [one for one in _earlier(numbers, place, chain) if one in costs]
        lengths = norms(points[before] - points[number]) + np.array([costs[one] for one in before]) + corner
        for at in np.argsort(lengths, kind="stable").tolist():
            if (before[at], number) in links or sees(before[at], number):
                costs[number], origin[number] = float(lengths[at]), before[at]
                break
    found = [last]
    while found[-1]:
        found.append(origin[found[-1]])
    return found[::-1]


def _earlier(numbers: Sequence[int], place: int, chain: Sequence[int]) -> Iterator[int]:
    """Yield the considered points before an index: the last points, and points in the chain."""
    first = max(0, place - _LOOK_BACK)
    yield from numbers[first:place]
    yield from (one for one in chain if one < numbers[first])
