"""Flags of pixels or voxels, packed row by row without gaps: eight per byte, the first in the highest bit."""

from __future__ import annotations

import math

import numpy as np

from robochoc.maps.occupancy.grid import Flags


def packed(flags: Flags) -> bytes:
    """Return the flags as bytes."""
    return np.packbits(flags).tobytes()


def unpacked(content: bytes, *shape: int) -> Flags:
    """Return the flags in `content`, which is long enough, as an array of a shape."""
    bits = np.unpackbits(np.frombuffer(content, dtype=np.uint8), count=math.prod(shape))
    return bits.reshape(shape).astype(bool)
