"""Lengths of the shortest ways from a pixel to all others, around obstacles.

Dijkstra's algorithm (1959) on the pixels with eight neighbours, in integers: a step across an edge counts 5 and a
diagonal one 7. The ratio is the one of the chamfer distance in Borgefors, "Distance transformations in digital
images", CVGIP 34 (1986), and 1 % less than the root of 2. A diagonal step cuts no corner: both pixels beside it have to
be passable.

All pixels of one distance are looked at together, as distances are integers (Dial, CACM 12, 1969).
"""

from __future__ import annotations

import heapq

import numpy as np
import numpy.typing as npt

from robochoc.formats.occupancy.grid import Flags

STRAIGHT, DIAGONAL = 5, 7
"""The lengths of steps."""
UNREACHED = -1

Lengths = npt.NDArray[np.int64]


def lengths_from(start: tuple[int, int], passable: Flags, longest: int | None = None) -> Lengths:
    """Return the lengths of the shortest ways to all pixels: `STRAIGHT` a pixel, or `UNREACHED`.

    Args:
        start: The row and the column of the pixel where all ways begin. It is passable.
        passable: The pixels on which ways lead.
        longest: Longer ways are not looked for.
    """
    free = np.pad(passable, 1)
    width = free.shape[1]
    flat = free.ravel()
    limit = np.iinfo(np.int64).max
    found = np.full(flat.size, limit, dtype=np.int64)
    here = (start[0] + 1) * width + start[1] + 1
    found[here] = 0
    waiting = {0: [np.array([here])]}
    lengths = [0]
    while lengths:
        length = heapq.heappop(lengths)
        pixels = np.unique(np.concatenate(waiting.pop(length)))
        pixels = pixels[found[pixels] == length]
        for step, beside in _steps(width):
            further = length + (DIAGONAL if beside else STRAIGHT)
            if longest is not None and further > longest:
                continue
            ends = pixels + step
            open_ends = flat[ends] & (found[ends] > further)
            for side in beside:
                open_ends &= flat[pixels + side]
            new = ends[open_ends]
            if new.size:
                found[new] = further
                if further not in waiting:
                    waiting[further] = []
                    heapq.heappush(lengths, further)
                waiting[further].append(new)
    found[found == limit] = UNREACHED
    return found.reshape(free.shape)[1:-1, 1:-1]


def _steps(width: int) -> list[tuple[int, tuple[int, ...]]]:
    """Return the eight steps in a flat array of rows so wide, each with the steps to the pixels beside a diagonal."""
    straight = [(step, ()) for step in (1, -1, width, -width)]
    return [*straight, *((up + side, (up, side)) for up in (width, -width) for side in (1, -1))]
