"""MGM for all robots at once: `protocols/local_search/mgm.py`, where the algorithm is explained."""

from __future__ import annotations

import numpy as np

from robochoc.communication.arrays.cycle_run import CycleRun, count, least, nth
from robochoc.communication.arrays.kinds import Flags, Integers
from robochoc.communication.arrays.tally import integer_bytes
from robochoc.model.message import encode
from robochoc.protocols.local_search.mgm import Gain

_REST = len(encode(Gain(0, 0))) - 2
"""Bytes of a gain but for its two numbers."""


class ArrayGainers(CycleRun):
    """The common base of MGM and MGM-2 (`Gainers`)."""

    def _weigh(self) -> None:
        self.burdens()

    def best_unilateral(self, found: list[Integers], of: Flags | None = None) -> tuple[Integers, Integers]:
        """Return the best move of each row alone, and its gain: of all rows, or those that a flag is set `of`."""
        targets, gains = self.values.copy(), np.zeros(self.layout.many, self.layout.costs.kind)
        for number, (group, burdens) in enumerate(zip(self.layout.groups, found, strict=True)):
            lowest = least(burdens)
            gain = self.present(number, burdens) - lowest
            if of is not None:
                gain[~of[group.first : group.first + group.active]] = 0
            gains[group.first : group.first + group.active] = gain
            moving = np.flatnonzero(gain)
            cheapest = burdens[moving] == lowest[moving, None]
            chosen = self.draws.any_of(moving + group.first, count(cheapest))
            targets[moving + group.first] = nth(cheapest, chosen).astype(targets.dtype)
        return targets, gains

    def tell_gains(self, gains: Integers) -> None:
        """Let robots tell all neighbours their gains."""
        costs = self.layout.costs
        lengths = _REST + integer_bytes(costs.broken(gains)) + integer_bytes(costs.paid(gains))
        self.tally.add(Gain.__name__, lengths, self.layout.degrees)

    def wins(self, gains: Integers, partners: Integers | None = None) -> Flags:
        """Return which robots gain most among their neighbours, `partners` aside; ties go to the first in the order."""
        greatest = np.zeros(self.layout.many, gains.dtype)
        for (group, lists, neighbours, _), higher in zip(self.layout.links, self.layout.higher, strict=True):
            part = greatest[group.first : group.last]
            told = gains.take(neighbours) + higher
            if partners is not None:
                told[partners[group.first : group.last][lists] == neighbours] = 0
            part[lists] = np.maximum(part[lists], told)
        return (gains > 0) & (greatest <= gains)


class ArrayMGM(ArrayGainers):
    """A run of MGM."""

    def _begin(self) -> None:
        self.take_any()
        self.tell_values()

    def _step(self) -> None:
        """Weigh moves, tell gains, and let those who gain most move (`MGM._weigh`, `MGM._move`)."""
        found = self.burdens()
        self.hear()
        self.count_checks(self.all_checks)
        targets, gains = self.best_unilateral(found)
        self.tell_gains(gains)
        self.hear()
        self.values = np.where(self.wins(gains), targets, self.values)
        if self.cycle + 1 < self.settings.cycles:
            self.tell_values()
