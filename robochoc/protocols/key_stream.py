"""The source of random keys for private protocols: the host gives each robot one, `Protocol.secret`.

Across machines it is the operating system's (`secrets.randbits`): nobody can compute the keys, and a run cannot be
repeated. In the simulator and in processes all robots are in one hand, the user's, and nothing is secret from it. There
it is a `KeyStream`, which follows from the run's seed, so that runs can be repeated and replayed. It is BLAKE2b in
counter mode, keyed by the seed and the robot's name: what a robot hears of keys tells nothing of others, unless it
knows the seed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from hashlib import blake2b
from typing import TypeVar

T = TypeVar("T")
_BLOCK = 64


class KeyStream:
    """The repeatable source of one robot: each call draws a number of so many bits."""

    def __init__(self, seed: int, name: str) -> None:
        self._key = blake2b(f"keys {seed} {name}".encode()).digest()
        self._drawn = 0

    def __call__(self, bits: int) -> int:
        """Return the next number, from 0 up to below 2 to the power of `bits` (512 at most)."""
        if not 0 < bits <= 8 * _BLOCK:
            raise ValueError(f"{bits} bits cannot be drawn at a time")
        self._drawn += 1
        block = blake2b(self._drawn.to_bytes(8, "little"), key=self._key).digest()
        return int.from_bytes(block, "little") >> 8 * _BLOCK - bits


def shuffled(items: Sequence[T], secret: Callable[[int], int]) -> list[T]:
    """Return `items` in a random order: each is as likely as any other, but for one in 2^64."""
    left = list(items)
    for place in range(len(left) - 1, 0, -1):
        other = secret(place.bit_length() + 64) % (place + 1)
        left[place], left[other] = left[other], left[place]
    return left
