"""Minimal Constraint Sharing MGM (MCS-MGM).

MGM for asymmetric costs: each robot computes gains for its own side. A robot's move may cost a neighbour more than the
robot has gained. Then the neighbour hands over the entry of its part that has become due: from then on the other robot
pays this entry. So the sum of both sides of each constraint stays the same, and the next move of that robot takes the
entry into account.

- **When to use**: asymmetric costs, many robots, and robots should disclose little about their costs.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. P_ij + P_ji, the total cost
  of both sides of a pair, never changes.
- **Parameters (`--set`)**: `cycles` (default 100).
- **Reference**: Grinshpoun, Grubshtein, Zivan, Netzer, Meisels: "Asymmetric distributed constraint optimization
  problems", JAIR 47, 2013 (MCS-MGM).

Information disclosed: the single entries of parts that are handed over, values, and gains.

Choices that the paper leaves open, and differences:

- A cycle has three phases: values, transfers (most of them empty), gains.
- No entry is handed over before a robot has moved.
- If neighbours have the same gain, the first of them in the priority order moves.
- Gains and entries are pairs, broken hard constraints first. Totally known constraints are paid by all robots in the
  scope, as in MGM, and never handed over.
- If a value is lost, the last known one is used; a robot that misses a gain does not move. A lost entry is no longer
  counted by either robot. P_ij + P_ji then decreases for the robots, but not in the result, whose cost is computed from
  the files.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.random_csp import random_csp
>>> team = random_csp(5, 3, 0.6, 0, max_cost=9, asymmetric=True)
>>> result = Simulation(team, MCSMGM, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Gain': 1200, 'Transfer': 1200, 'Value': 1200}
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.local_search.mgm import Gain, Gainers, saving_in_words
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.cycles import NO_GAIN, CycleCount, Value, gain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LexicographicCost, LocalProblem


class Transfer(Message, frozen=True):
    """An entry in the sender's part, at both robots' values: from now on the receiver pays it. None: no transfer.

    A cost is a pair: broken hard constraints, and costs.
    """

    entry: tuple[int, int | float] | None

    act = Act(Performative.INFORM, "the receiver learns the cost of its move for the sender, if that is too high")
    # The entry may contain costs that were handed over before.
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        if self.entry is None:
            return "I have no costs to hand over to you"
        return f"you pay my side of our two values from now on: {saving_in_words(*self.entry)}"


Entry = tuple[int, wire.Value]
"""An entry on this robot's side: the index of its value, and the other robot's value."""


class MCSMGM(Gainers):
    """One agent of MCS-MGM.

    `changed` contains, for each neighbour, the differences between entries on this robot's side and its original part:
    entries handed over are added or subtracted. `last_gains` are the neighbours' last gains.
    """

    messages = Value | Transfer | Gain
    settings: ClassVar[CycleCount] = CycleCount()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Grinshpoun, Grubshtein, Zivan, Netzer & Meisels 2013",
        complete=False,
        costs=True,
        partially_known=True,
        asymmetric=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="parts of PKC but for entries that are handed over",
        use_when="asymmetric costs, many robots, little disclosed of them",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.changed: dict[str, dict[Entry, LexicographicCost]] = {name: {} for name in problem.neighbours}
        self.last_gains: dict[str, LexicographicCost] = {}
        self._values: dict[str, wire.Value] = {}

    def start_cycles(self) -> None:
        """Choose a random value."""
        self.choose(self.any_value())
        self.exchange_values(self._transfer)

    def side(self, neighbour: str, value: wire.Value) -> LexicographicCost:
        """Return this robot's cost for its present value and `value`, including all transfers."""
        plain = self.problem.own_side(self.present, neighbour, value)
        return _sum(plain, self.changed[neighbour].get((self.present, value), NO_GAIN))

    def burdens(self, view: Mapping[str, wire.Value]) -> list[LexicographicCost]:
        """Return the cost of every value of this robot, including all transfers."""
        costs = self.problem.lexicographic_costs(view)
        for name, value in view.items():
            changed = self.changed[name]
            if changed:
                costs = [_sum(cost, changed.get((index, value), NO_GAIN)) for index, cost in enumerate(costs)]
        return costs

    def too_much(self, loss: LexicographicCost, gained: LexicographicCost) -> bool:
        """Return whether a neighbour's move, by which it `gained`, has cost this robot enough for a transfer."""
        return loss > max(gained, NO_GAIN)

    def _transfer(self, messages: Mapping[str, wire.Message]) -> None:
        """Hand over the entries that are due after neighbours' moves, once all neighbours' values are known."""
        values = self.checked_values(messages)
        entries: dict[str, LexicographicCost | None] = {}
        for name, value in values.items():
            before = self._values.get(name, value)
            entry = None
            if value != before:
                now = self.side(name, value)
                if self.too_much(gain(now, self.side(name, before)), self.last_gains.get(name, NO_GAIN)):
                    entry = now
                    self._add(name, value, gain(NO_GAIN, now))
            entries[name] = entry
        for name in self.problem.neighbours:
            self.send(name, Transfer(entries.get(name)))
        self._values = values
        self.listen(self.problem.neighbours, self._weigh)

    def _weigh(self, messages: Mapping[str, wire.Message]) -> None:
        """Add the received entries, and send the gain of this robot's best move."""
        for name, message in messages.items():
            if isinstance(message, Transfer) and message.entry is not None and name in self._values:
                self._add(name, self._values[name], message.entry)
        self.find_best_move(self.burdens(self._values))
        self.multicast(self.problem.neighbours, Gain(*self.gain))
        self.listen(self.problem.neighbours, self._move)

    def _move(self, messages: Mapping[str, wire.Message]) -> None:
        """Move if this robot's gain is the largest, once all neighbours' gains are known."""
        self.last_gains = {
            name: (message.broken, message.cost) for name, message in messages.items() if isinstance(message, Gain)
        }
        if len(self.last_gains) < len(messages):
            raise ValueError(f"a neighbour of {self.problem.agent} sent a message other than its gain in this phase")
        moves = len(messages) == len(self.problem.neighbours) and self.wins(messages)
        self.choose(self.target if moves else self.present)
        if not self.finished:
            self.exchange_values(self._transfer)

    def _add(self, neighbour: str, value: wire.Value, cost: LexicographicCost) -> None:
        """Add `cost` to the entry on this robot's side for its present value and `value` of a neighbour."""
        entry = (self.present, value)
        self.changed[neighbour][entry] = _sum(self.changed[neighbour].get(entry, NO_GAIN), cost)


def _sum(one: LexicographicCost, other: LexicographicCost) -> LexicographicCost:
    return one[0] + other[0], one[1] + other[1]
