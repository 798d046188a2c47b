"""Lists of different lengths, column by column: the first entries of all lists, then the second ones, and so on.

A column is one array, so a sum over each list is as many additions of whole arrays as the longest list has entries,
one after the other in the order of the list: no sum rounds otherwise than a loop would. (Jagged diagonals, as sparse
matrices are stored on vector machines: Saad, "Krylov subspace methods on supercomputers", 1989.)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robochoc.communication.arrays.kinds import Index, Integers


def columns(lengths: Integers) -> Iterator[tuple[Index, Integers]]:
    """Yield, for each column, the lists that reach it, and where their entries stand if lists follow each other.

    Lists are a slice where none is longer than the one before it.
    """
    starts = np.cumsum(lengths) - lengths
    order = np.argsort(-lengths, kind="stable")
    sorted_already = bool((order == np.arange(len(order))).all())
    falling = -lengths[order]
    for column in range(int(lengths.max(initial=0))):
        reach = int(np.searchsorted(falling, -column))
        lists = order[:reach]
        yield (slice(reach) if sorted_already else lists), starts[lists] + column


def segments(lengths: Integers) -> Integers:
    """Return the number of its list for each entry, if lists follow each other."""
    return np.repeat(np.arange(len(lengths)), lengths)


def narrowest(largest: int) -> np.dtype[np.integer]:
    """Return the smallest type of integers that holds 0 to `largest`, and -1."""
    for kind in (np.int8, np.int16, np.int32):
        if largest <= np.iinfo(kind).max:
            return np.dtype(kind)
    return np.dtype(np.int64)
