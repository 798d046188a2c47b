"""Flags of pixels, or voxels, as bytes: eight a byte, the first one highest, row by row without gaps."""

from __future__ import annotations

import math

import numpy as np

from robochoc.maps.occupancy.grid import Flags


def packed(flags: Flags) -> bytes:
    """Return the flags as bytes."""
    return np.packbits(flags).tobytes()


def unpacked(content: bytes, *shape: int) -> Flags:
    """Return the flags in bytes, of which there are enough, as an array of a shape."""
    bits = np.unpackbits(np.frombuffer(content, dtype=np.uint8), count=math.prod(shape))
    return bits.reshape(shape).astype(bool)
