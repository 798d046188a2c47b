"""DSA for all robots at once. `protocols/local_search/dsa.py` explains the algorithm."""

from __future__ import annotations

from typing import cast

import numpy as np

from robochoc.communication.arrays.array_types import Flags, Floats, Integers
from robochoc.communication.arrays.cycle_run import CycleRun, count, least, nth
from robochoc.communication.arrays.layout import RobotGroup
from robochoc.protocols.local_search.dsa import DSASettings


class ArrayDSA(CycleRun):
    """A run of DSA."""

    clocks_depend_on_values = False
    in_blocks = True

    def _start_active(self) -> None:
        self.choose_first_values()
        self.send_values()

    def _step(self) -> None:
        """Move or stay (`StochasticSearch.choice`)."""
        if self.kernels is not None:
            values, account = self.kernels.dsa(self.values, *self._chances())
            self.note_account(account)
            self.values = values
        else:
            for number, (group, value_costs) in enumerate(zip(self.layout.groups, self.value_costs(), strict=True)):
                self._choose(number, group, value_costs)
        self.receive_values()
        if self.cycle + 1 < self.settings.cycles:
            self.send_values()

    def _weigh(self) -> None:
        self.value_costs()

    def _choose(self, number: int, group: RobotGroup, value_costs: Integers) -> None:
        own = group.values(self.values)[: group.active]
        now, lowest = self.present(number, value_costs), least(value_costs)
        cheapest = value_costs == lowest[:, None]
        gains = now > lowest
        others = count(cheapest) - ~gains
        able = np.flatnonzero((gains | self._sideways(number, group, now)) & (others > 0))
        moving = able[self.draws.draw(able + group.first) < self._probability(gains[able])]
        choices = cheapest[moving]
        choices[np.arange(len(moving)), own[moving]] = False
        chosen = self.draws.choose(moving + group.first, others[moving])
        own[moving] = nth(choices, chosen).astype(own.dtype)

    def _chances(self) -> tuple[int, float, float]:
        """Return the code in C of moves without a gain, their probability, and the probability of other moves."""
        settings = cast("DSASettings", self.settings)
        sideways = 0 if settings.variant == "A" else 1 if settings.variant in "CE" else 2
        return sideways, settings.probability, 1.0 if settings.variant in "DE" else settings.probability

    def _probability(self, gains: Flags) -> Floats | float:
        """Return the probability that each robot moves. `gains` marks robots whose move is a gain."""
        settings = cast("DSASettings", self.settings)
        return np.where(gains, 1.0, settings.probability) if settings.variant in "DE" else settings.probability

    def _sideways(self, number: int, group: RobotGroup, now: Integers) -> Flags | bool:
        """Return the robots for which the variant allows moves without a gain (`DSA._probability`)."""
        variant = cast("DSASettings", self.settings).variant
        if variant not in "BD":
            return variant in "CE"
        alone = 0 if group.charges is None else self.present(number, group.charges[: group.active])
        conflict: Flags = now != alone
        return conflict
