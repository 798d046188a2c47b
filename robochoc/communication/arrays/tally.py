"""The message counts in an array run: messages by type, bytes, the largest size."""

from __future__ import annotations

import numpy as np

from robochoc.communication.arrays.array_types import Integers

_SHORT_LIST, _LONG_LIST = 16, 65_536
"""The lengths from which lists have longer headers in msgpack."""
_LEAST_BYTE, _LARGEST_BYTE = -32, 127
"""The range of integers encoded in one byte."""
_SIZES = ((-(2**31), 9), (-(2**15), 5), (-(2**7), 3), (-(2**5), 2), (128, 1), (256, 2), (65_536, 3), (2**32, 5))


class MessageTally:
    """Counts of messages."""

    def __init__(self) -> None:
        self.messages: dict[str, int] = {}
        self.bytes = self.largest = 0

    def add(self, kind: str, sizes: Integers | int, copies: Integers | int) -> None:
        """Count messages of type `kind`: `copies` messages with each of the `sizes` in bytes. Numbers apply to all."""
        many = int(np.sum(copies))
        if not many:
            return
        sent = sizes[np.asarray(copies) > 0] if isinstance(sizes, np.ndarray) and np.ndim(copies) else sizes
        total = int(np.sum(sizes * copies)) if isinstance(sizes, np.ndarray) else sizes * many
        self.count(kind, many, total, int(np.max(sent)))

    def count(self, kind: str, many: int, total: int, largest: int) -> None:
        """Count `many` messages of type `kind` with `total` bytes."""
        self.messages[kind] = self.messages.get(kind, 0) + many
        self.bytes += total
        self.largest = max(self.largest, largest)


def integer_bytes(numbers: Integers) -> Integers:
    """Return the size of each of `numbers` in msgpack, in bytes."""
    if not numbers.size or (numbers.min() >= _LEAST_BYTE and numbers.max() <= _LARGEST_BYTE):
        return np.ones(numbers.shape, np.int64)
    bounds = np.array([bound for bound, _ in _SIZES])
    sizes = np.array([*(size for _, size in _SIZES), 9])
    found: Integers = sizes[np.searchsorted(bounds, numbers, side="right")]
    return found


def list_bytes(length: Integers | int) -> Integers:
    """Return the size of the header of a list of this `length` in msgpack, in bytes."""
    lengths = np.asarray(length)
    return np.where(lengths < _SHORT_LIST, 1, np.where(lengths < _LONG_LIST, 3, 5))
