"""The random numbers of a robot: a counter-based generator, keyed by the run's seed and the robot's name.

Draw n (1, 2, ...) is a hash of key + n * step, modulo 2**64: SplitMix64 (Steele, Lea, Flood: "Fast splittable
pseudorandom number generators", OOPSLA 2014), with Stafford's 13th variant of its mixing function. Key and step are two
halves of a BLAKE2b digest of seed and name, so similar names have independent streams. A robot's n-th number depends on
nothing else, in particular neither on the runtime nor on other robots' draws. Plain Python computes a number from two
words of state in a third of a microsecond; numpy computes the same numbers for all robots at once
(`communication/arrays/cycle_run.py`).

Secrets must not depend on this generator: see `key_stream.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, TypeVar

from robochoc.system.blake2 import blake2b

T = TypeVar("T")

MASK: Final = 0xFFFF_FFFF_FFFF_FFFF
FIRST_FACTOR: Final = 0xBF58_476D_1CE4_E5B9
SECOND_FACTOR: Final = 0x94D0_49BB_1331_11EB
UNIT: Final = 2.0**-53
"""The distance between neighbouring random numbers: every random number is k / 2**53."""

_ALTERNATING: Final = 0xAAAA_AAAA_AAAA_AAAA
_FEWEST_TRANSITIONS: Final = 24


def key_and_step(seed: int, name: str) -> tuple[int, int]:
    """Return the two words that determine the numbers of the robot `name`; the step is odd.

    As in `mixGamma` of the paper, a step whose bits change too seldom is replaced by one whose bits change often.
    """
    digest = blake2b(f"{seed} {name}".encode(), digest_size=16).digest()
    step = int.from_bytes(digest[8:], "little") | 1
    if (step ^ step >> 1).bit_count() < _FEWEST_TRANSITIONS:
        step ^= _ALTERNATING
    return int.from_bytes(digest[:8], "little"), step


def one_of(chance: Callable[[], float], choices: Sequence[T]) -> T:
    """Return a random element of `choices`; with a single choice, no random number is drawn."""
    return choices[0] if len(choices) == 1 else choices[int(chance() * len(choices))]


class Chance:
    """The random stream of one robot: each call returns the next number, uniform in [0, 1) with 53 bits."""

    __slots__ = ("_state", "_step")

    def __init__(self, seed: int, name: str) -> None:
        self._state, self._step = key_and_step(seed, name)

    def __call__(self) -> float:
        """Return the next number."""
        self._state = bits = (self._state + self._step) & MASK
        bits = (bits ^ bits >> 30) * FIRST_FACTOR & MASK
        bits = (bits ^ bits >> 27) * SECOND_FACTOR & MASK
        return ((bits ^ bits >> 31) >> 11) * UNIT
