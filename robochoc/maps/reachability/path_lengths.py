"""Lengths of the shortest paths from a pixel, or a voxel, to all others, around obstacles.

Dijkstra's algorithm (1959) is used on pixels with eight neighbours, or voxels with 26, in integers: a step across a
face counts 15, across an edge 21, and across a corner 26. In the plane, the ratio is that of 5 and 7 in the chamfer
distance of Borgefors, "Distance transformations in digital images", CVGIP 34 (1986), 1 % less than the square root of
2. The third length is less than 0.1 % more than the square root of 3. Diagonal steps cut no corners: all pixels beside
   the
step must be passable. If a robot does not fit between two neighbours, neither a step between these nor a diagonal step
past their border is possible.

Lengths are integers, and no step is shorter than 15. So pixels whose lengths differ by less do not depend on each
other, and are processed together (Dial, CACM 12, 1969).
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robochoc.maps.occupancy.grid import Flags

STRAIGHT, DIAGONAL, SPACE_DIAGONAL = 15, 21, 26
"""The lengths of steps along one axis, two and three."""
UNREACHED = -1

Lengths = npt.NDArray[np.int32]
_LONGEST = np.iinfo(np.int32).max - SPACE_DIAGONAL


class _Step(NamedTuple):
    """A step in a flat array: its offset, the pixels beside the step, the crossed borders by axis, and its length."""

    to: int
    beside: tuple[int, ...]
    crossed: tuple[tuple[int, ...], ...]
    length: int


def lengths_from(
    start: tuple[int, ...], passable: Flags, longest: int | None = None, joined: Sequence[Flags] = ()
) -> Lengths:
    """Return the lengths of the shortest paths to all pixels: `STRAIGHT` per pixel, or `UNREACHED`.

    Args:
        start: The indices of the passable pixel at which all paths begin.
        passable: Which pixels are passable, in an array with two or three dimensions.
        longest: The maximum length of paths.
        joined: For each axis, the pixels from which a robot can move to the next pixel. Empty: all pixels.
    """
    free = np.pad(passable, 1)
    flat = free.ravel()
    limit = _LONGEST if longest is None else min(longest, _LONGEST)
    found = np.full(flat.size, np.iinfo(np.int32).max, dtype=np.int32)
    here = int(np.ravel_multi_index(tuple(part + 1 for part in start), free.shape))
    found[here] = 0
    waiting = {0: [np.array([here])]}
    rounds = [0]
    steps = _steps(free.shape)
    through = [np.pad(flags, 1).ravel() for flags in joined]
    while rounds:
        this = heapq.heappop(rounds)
        pixels = np.unique(np.concatenate(waiting.pop(this)))
        lengths = found[pixels]
        now = lengths // STRAIGHT == this
        pixels, lengths = pixels[now], lengths[now]
        for step, beside, crossed, length in steps:
            ends, further = pixels + step, lengths + length
            better = flat[ends] & (found[ends] > further) & (further <= limit)
            for side in beside:
                better &= flat[pixels + side]
            for flags, some in zip(through, crossed, strict=False):
                for side in some:
                    better &= flags[pixels + side]
            new, further = ends[better], further[better]
            found[new] = further
            for later in np.unique(further // STRAIGHT).tolist():
                if later not in waiting:
                    waiting[later] = []
                    heapq.heappush(rounds, later)
                waiting[later].append(new[further // STRAIGHT == later])
    found[found > limit] = UNREACHED
    return found.reshape(free.shape)[(slice(1, -1),) * free.ndim]


def _steps(shape: tuple[int, ...]) -> list[_Step]:
    """Return all steps in the flat array for a shape."""
    strides = [int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))]
    found = []
    for moves in product((-1, 0, 1), repeat=len(shape)):
        parts = [move * stride for move, stride in zip(moves, strides, strict=True)]
        if any(moves):
            some = [sum(chosen) for chosen in product(*((0, part) for part in parts if part))]
            length = (STRAIGHT, DIAGONAL, SPACE_DIAGONAL)[sum(map(abs, moves)) - 1]
            found.append(_Step(some[-1], tuple(some[1:-1]), _crossed(parts), length))
    return found


def _crossed(parts: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Return, by axis, the pixels whose border to the next pixel a step crosses or passes: all edges of its box."""
    found = []
    for axis, part in enumerate(parts):
        others = product(*((0, other) for other in (*parts[:axis], *parts[axis + 1 :]) if other))
        found.append(tuple(min(part, 0) + sum(chosen) for chosen in others) if part else ())
    return tuple(found)
