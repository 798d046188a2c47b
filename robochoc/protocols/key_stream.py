"""The source of random keys for private protocols: the host gives each robot a source, `Protocol.secret`.

Across machines the source is that of the operating system (`secrets.randbits`): the keys cannot be predicted, and a run
cannot be repeated. In the simulator and in processes all robots belong to one user, and nothing is secret from that
user. There the source is a `KeyStream`, determined by the run's seed, so that runs can be repeated and replayed. It is
BLAKE2b in counter mode, keyed by the seed and the robot's name: without the seed, known keys reveal nothing about other
keys.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from robochoc.system.blake2 import blake2b

T = TypeVar("T")
_BLOCK = 64


class KeyStream:
    """The repeatable source of keys for one robot: each call draws a number with the given number of bits."""

    def __init__(self, seed: int, name: str) -> None:
        self._key = blake2b(f"keys {seed} {name}".encode()).digest()
        self._drawn = 0

    def __call__(self, bits: int) -> int:
        """Return the next number, at least 0 and less than 2 to the power of `bits` (at most 512)."""
        if not 0 < bits <= 8 * _BLOCK:
            raise ValueError(f"cannot draw {bits} bits at a time; it must be 1 to {8 * _BLOCK}")
        self._drawn += 1
        block = blake2b(self._drawn.to_bytes(8, "little"), key=self._key).digest()
        return int.from_bytes(block, "little") >> 8 * _BLOCK - bits


def shuffled(items: Sequence[T], secret: Callable[[int], int]) -> list[T]:
    """Return `items` in a random order; all orders are equally likely up to a deviation of 2^-64."""
    left = list(items)
    for place in range(len(left) - 1, 0, -1):
        other = secret(place.bit_length() + 64) % (place + 1)
        left[place], left[other] = left[other], left[place]
    return left
