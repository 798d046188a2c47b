"""MGM for all robots at once. `protocols/local_search/mgm.py` explains the algorithm."""

from __future__ import annotations

import numpy as np

from robochoc.communication.arrays.array_types import Flags, Integers
from robochoc.communication.arrays.cycle_run import CycleRun, count, least, nth
from robochoc.communication.arrays.kernels import Kernels
from robochoc.communication.arrays.tally import integer_bytes
from robochoc.protocols.local_search.mgm import Gain
from robochoc.protocols.message import encode

_REST = len(encode(Gain(0, 0))) - 2
"""The size of a gain message without its two numbers, in bytes."""


class ArrayGainers(CycleRun):
    """The common base of MGM and MGM-2 (`Gainers`)."""

    def _weigh(self) -> None:
        self.value_costs()

    def best_unilateral(self, found: list[Integers], of: Flags | None = None) -> tuple[Integers, Integers]:
        """Return the best unilateral move and its gain for each row, or only for the rows with a flag in `of`."""
        targets, gains = self.values.copy(), np.zeros(self.layout.many, self.layout.costs.kind)
        for number, (group, value_costs) in enumerate(zip(self.layout.groups, found, strict=True)):
            lowest = least(value_costs)
            gain = self.present(number, value_costs) - lowest
            if of is not None:
                gain[~of[group.first : group.first + group.active]] = 0
            gains[group.first : group.first + group.active] = gain
            moving = np.flatnonzero(gain)
            cheapest = value_costs[moving] == lowest[moving, None]
            chosen = self.draws.choose(moving + group.first, count(cheapest))
            targets[moving + group.first] = nth(cheapest, chosen).astype(targets.dtype)
        return targets, gains

    def send_gains(self, gains: Integers) -> None:
        """Send the gains of all robots to their neighbours."""
        costs = self.layout.costs
        lengths = _REST + integer_bytes(costs.broken(gains)) + integer_bytes(costs.paid(gains))
        self.tally.add(Gain.__name__, lengths, self.layout.degrees)
        self.border.exchange(gains, self.clocks if self.clocks_depend_on_values else None)

    def wins(self, gains: Integers, partners: Integers | None = None) -> Flags:
        """Return the robots that gain most among their neighbours except `partners`. The highest wins ties."""
        greatest = np.zeros(self.layout.many, gains.dtype)
        for (group, lists, neighbours, _), higher in zip(self.layout.links, self.layout.higher, strict=True):
            part = greatest[group.first : group.last]
            others = gains.take(neighbours) + higher
            if partners is not None:
                others[partners[group.first : group.last][lists] == neighbours] = 0
            part[lists] = np.maximum(part[lists], others)
        return (gains > 0) & (greatest <= gains)


class ArrayMGM(ArrayGainers):
    """A run of MGM."""

    clocks_depend_on_values = False
    in_blocks = True

    def _start_active(self) -> None:
        self.choose_first_values()
        self.send_values()

    def _step(self) -> None:
        """Compute the moves, send gains, and move the robots that gain most (`MGM._send_gain`, `MGM._move`)."""
        if self.kernels is not None:
            self._step_compiled(self.kernels)
        else:
            found = self.value_costs()
            self.receive_values()
            targets, gains = self.best_unilateral(found)
            self.send_gains(gains)
            self.receive()
            self.values = np.where(self.wins(gains), targets, self.values)
        if self.cycle + 1 < self.settings.cycles:
            self.send_values()

    def _step_compiled(self, kernels: Kernels) -> None:
        targets, gains, account = kernels.best_unilateral(self.values, _REST)
        self.note_account(account)
        self.receive_values()
        self.tally.count(Gain.__name__, self.links, account.bytes, account.largest)
        self.border.exchange(gains)
        self.receive()
        kernels.move_winners(self.values, targets, gains)
