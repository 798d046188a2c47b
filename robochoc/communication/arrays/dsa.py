"""DSA for all robots at once: `protocols/local_search/dsa.py`, where the algorithm is explained."""

from __future__ import annotations

from typing import cast

import numpy as np

from robochoc.communication.arrays.cycle_run import CycleRun, count, least, nth
from robochoc.communication.arrays.kinds import Flags, Floats, Integers
from robochoc.communication.arrays.layout import Group
from robochoc.protocols.local_search.dsa import DSASettings


class ArrayDSA(CycleRun):
    """A run of DSA."""

    def _begin(self) -> None:
        self.take_any()
        self.tell_values()

    def _step(self) -> None:
        """Move or stay (`StochasticSearch.choice`)."""
        found = self.burdens()
        self.hear()
        self.count_checks(self.all_checks)
        for number, (group, burdens) in enumerate(zip(self.layout.groups, found, strict=True)):
            self._choose(number, group, burdens)
        if self.cycle + 1 < self.settings.cycles:
            self.tell_values()

    def _weigh(self) -> None:
        self.burdens()

    def _choose(self, number: int, group: Group, burdens: Integers) -> None:
        own = group.values(self.values)[: group.active]
        now, lowest = self.present(number, burdens), least(burdens)
        cheapest = burdens == lowest[:, None]
        gains = now > lowest
        others = count(cheapest) - ~gains
        able = np.flatnonzero((gains | self._sideways(number, group, now)) & (others > 0))
        moving = able[self.draws.draw(able + group.first) < self._probability(gains[able])]
        choices = cheapest[moving]
        choices[np.arange(len(moving)), own[moving]] = False
        chosen = self.draws.any_of(moving + group.first, others[moving])
        own[moving] = nth(choices, chosen).astype(own.dtype)

    def _probability(self, gains: Flags) -> Floats | float:
        """Return with what probability each robot moves, where those that gain do as `gains` says."""
        settings = cast("DSASettings", self.settings)
        return np.where(gains, 1.0, settings.probability) if settings.variant in "DE" else settings.probability

    def _sideways(self, number: int, group: Group, now: Integers) -> Flags | bool:
        """Return where the variant allows a move that gains nothing (`DSA._probability`)."""
        variant = cast("DSASettings", self.settings).variant
        if variant not in "BD":
            return variant in "CE"
        alone = 0 if group.charges is None else self.present(number, group.charges[: group.active])
        conflict: Flags = now != alone
        return conflict
