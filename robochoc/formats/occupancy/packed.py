"""Flags of pixels as bytes: eight pixels a byte, the first one highest, row by row without gaps."""

from __future__ import annotations

import numpy as np

from robochoc.formats.occupancy.grid import Flags


def packed(flags: Flags) -> bytes:
    """Return the flags as bytes."""
    return np.packbits(flags).tobytes()


def unpacked(content: bytes, rows: int, columns: int) -> Flags:
    """Return the flags in bytes, of which there are enough."""
    bits = np.unpackbits(np.frombuffer(content, dtype=np.uint8), count=rows * columns)
    return bits.reshape(rows, columns).astype(bool)
