"""Rectangles that cover the set pixels of a map, for drawings and constraints."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Flags = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.int64]


def few_rectangles(flags: Flags, most: int) -> tuple[Numbers, int]:
    """Return at most `most` rectangles that cover the set flags, and the length of their unit in pixels."""
    factor = 1
    while len(found := rectangles(flags)) > most:
        factor *= 2
        rows, columns = flags.shape
        even = np.pad(flags, ((0, rows % 2), (0, columns % 2)))
        flags = even[::2, ::2] | even[1::2, ::2] | even[::2, 1::2] | even[1::2, 1::2]
    return found, factor


def rectangles(flags: Flags) -> Numbers:
    """Return rectangles (K, 4) that cover exactly the set flags: the least x and y, and the first x and y beyond.

    Consecutive pixels in a row are merged, and then equal runs in consecutive rows.
    """
    steps = np.diff(np.pad(flags, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, begin = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    order = np.lexsort((row, end, begin))
    row, begin, end = row[order], begin[order], end[order]
    new = np.ones(len(row), dtype=bool)
    new[1:] = (np.diff(begin) != 0) | (np.diff(end) != 0) | (np.diff(row) != 1)
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(row)) - 1 if len(first) else first
    return np.column_stack((begin[first], row[first], end[first], row[last] + 1)).astype(np.int64)
