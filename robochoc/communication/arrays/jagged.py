"""Lists of different lengths, stored column by column: the first entries of all lists, then the second ones, and so on.

A column is one array, so summing all lists takes as many array additions as the longest list has entries. Entries are
added in the order of the list, so the sum is rounded as in a loop. (Jagged diagonals, the storage of sparse matrices on
vector machines: Saad, "Krylov subspace methods on supercomputers", 1989.)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robochoc.communication.arrays.array_types import Index, Integers


def columns(lengths: Integers) -> Iterator[tuple[Index, Integers]]:
    """Yield, for each column, the lists long enough for it, and the indices of their entries in the concatenated lists.

    If the lists are sorted by descending length, they are yielded as a slice.
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
    """Return, for each entry of concatenated lists, the index of its list."""
    return np.repeat(np.arange(len(lengths)), lengths)


def narrowest(largest: int) -> np.dtype[np.integer]:
    """Return the smallest integer type for the numbers from -1 to `largest`."""
    for kind in (np.int8, np.int16, np.int32):
        if largest <= np.iinfo(kind).max:
            return np.dtype(kind)
    return np.dtype(np.int64)
