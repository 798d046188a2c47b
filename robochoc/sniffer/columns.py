"""Columns: numbers of one kind, row after row, that only ever grow; and what of them travels to a page."""

from __future__ import annotations

import sys
from array import array
from collections.abc import Iterable
from typing import TypeAlias

NOT_YET = 0xFFFFFFFF
"""Stands for a step or a message that there is not, in columns of unsigned integers of 4 bytes."""

Column: TypeAlias = "array[float] | array[int]"


def floats() -> array[float]:
    """Return an empty column of floats of 8 bytes."""
    return array("d")


def longs() -> array[int]:
    """Return an empty column of unsigned integers of 4 bytes."""
    return array("I")


def shorts() -> array[int]:
    """Return an empty column of unsigned integers of 2 bytes."""
    return array("H")


def packed_columns(parts: Iterable[Column]) -> bytes:
    """Return the columns as bytes, one after the other, little-endian."""
    return b"".join(map(_little_endian, parts))


def _little_endian(column: Column) -> bytes:
    if sys.byteorder == "big":
        column = column[:]
        column.byteswap()
    return column.tobytes()
