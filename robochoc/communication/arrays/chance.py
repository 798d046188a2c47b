"""The random numbers of all robots at once, the same as `protocols/chance.py` computes one after the other."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from robochoc.communication.arrays.kinds import Index, Integers, Places
from robochoc.protocols.chance import FIRST_FACTOR, SECOND_FACTOR, UNIT, key_and_step

_FIRST, _SECOND = np.uint64(FIRST_FACTOR), np.uint64(SECOND_FACTOR)
_FLOAT_BITS = np.uint64(11)


class Draws:
    """The streams of robots: two words for each."""

    def __init__(self, seed: int, names: Iterable[str], many: int) -> None:
        words = (word for name in names for word in key_and_step(seed, name))
        pairs = np.fromiter(words, np.uint64, 2 * many).reshape(many, 2)
        self._states, self._steps = np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1])

    def draw(self, robots: Index) -> NDArray[np.float64]:
        """Return the next number of each of `robots`, none of which is named twice."""
        bits = self._states[robots] + self._steps[robots]
        self._states[robots] = bits
        mixed = (bits ^ bits >> np.uint64(30)) * _FIRST
        mixed = (mixed ^ mixed >> np.uint64(27)) * _SECOND
        mixed ^= mixed >> np.uint64(31)
        return (mixed >> _FLOAT_BITS).astype(np.float64) * UNIT

    def any_of(self, robots: Places, many: Integers) -> Integers:
        """Return, for each of `robots`, a random number below `many`; where there is one choice, nothing is drawn."""
        chosen = np.zeros(len(robots), np.int64)
        several = np.flatnonzero(many > 1)
        chosen[several] = (self.draw(robots[several]) * many[several]).astype(np.int64)
        return chosen
