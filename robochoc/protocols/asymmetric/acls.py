"""Asymmetric Coordinated Local Search (ACLS).

Local search in cycles for asymmetric costs. Each robot proposes a value that improves its own side, drawn in proportion
to the improvement. Its neighbours answer with the costs of their own sides, now and with the proposed value. So the
robot knows the costs of its move for both sides, and moves with a given probability if it is cheap enough.

- **When to use**: asymmetric costs, many robots, a good result without proof.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality.
- **Parameters (`--set`)**: `coordination` (c, default 0.8), `probability` (default 0.5), `cycles` (default 100).
- **Reference**: Grinshpoun, Grubshtein, Zivan, Netzer, Meisels: "Asymmetric distributed constraint optimization
  problems", JAIR 47, 2013 (Section on local search).

Information disclosed: for each proposal, the sum of a neighbour's own side in two entries.

Choices that the paper leaves open, and differences:

- The present costs are requested in every cycle, so they are correct after neighbours have moved.
- Broken hard constraints come before costs: a proposal that breaks fewer of them is cheaper, a proposal that breaks
  more is rejected. c applies to costs.
- Totally known constraints are part of every robot's own costs; they may be n-ary.
- If a value is lost, the last known one is used. A robot that misses a neighbour's side does not move.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.random_csp import random_csp
>>> team = random_csp(5, 3, 0.6, 0, max_cost=9, asymmetric=True)
>>> result = Simulation(team, ACLS, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Proposal': 1200, 'Sides': 1200, 'Value': 1200}
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import ClassVar

from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import INFINITE, NOTHING, PartPays, Proof, Reception, can_take
from robochoc.protocols.local_search.mgm import saving_in_words
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.cycles import NO_GAIN, CycleCount, CycleProtocol, Value, gain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LexicographicCost, LocalProblem


class ACLSSettings(CycleCount, frozen=True):
    """`coordination` (c): a proposal is accepted if c times its cost is below the present cost; 1: if it is cheaper.

    `probability` (p): the probability of a move. `cycles`: the number of cycles.
    """

    coordination: float = 0.8
    probability: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.coordination <= 1:
            raise ValueError(f"coordination is {self.coordination:g}; it must be more than 0 and at most 1")
        if not 0 < self.probability <= 1:
            raise ValueError(f"probability is {self.probability:g}; it must be more than 0 and at most 1")


Paid = tuple[int, int | float]
"""Broken hard constraints, and costs."""


class Proposal(wire.Message, frozen=True):
    """The value that the sender would like to take; None if it has no proposal (`proposal`)."""

    value: wire.Value | None

    act = Act(Performative.QUERY_REF, "the sender asks for the receiver's cost with its proposal")

    def in_words(self, words: Wording) -> str:
        if self.value is None:
            return "I propose no other value in this cycle"
        return f"{words.own_value(self.value)} is what I propose: what would it cost you?"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return NOTHING if self.value is None else [can_take(reception.sender, self.value)]


class Sides(wire.Message, frozen=True):
    """The sender's own side towards the receiver: with the receiver's value now, and with its proposal (`impact`)."""

    now: Paid
    proposed: Paid

    act = Act(Performative.INFORM, "the answer to `Proposal`")

    def in_words(self, _: Wording) -> str:
        return f"my side costs {saving_in_words(*self.now)} now, and {saving_in_words(*self.proposed)} as you propose"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The cost of the sender's part with both values of the receiver.
        wanted = reception.last(Proposal, reception.receiver, reception.sender)
        own = reception.last(Value, reception.receiver, reception.sender)
        theirs = reception.last(Value, reception.sender, reception.receiver)
        if wanted is None or wanted.value is None or own is None or theirs is None:
            return NOTHING
        sides = ((own.value, self.now), (wanted.value, self.proposed))
        return [
            PartPays(reception.sender, theirs.value, reception.receiver, value, INFINITE if broken else cost)
            for value, (broken, cost) in sides
        ]


class ACLS(CycleProtocol):
    """One agent of ACLS. State: the `proposal` of this cycle, and the costs of both sides `before` and `after` it."""

    messages = Value | Proposal | Sides
    settings: ClassVar[ACLSSettings] = ACLSSettings()
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
        privacy="parts of PKC but for entries that proposals ask for",
        use_when="asymmetric costs, many robots",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.proposal: int | None = None
        self.before: LexicographicCost = NO_GAIN
        self.after: LexicographicCost = NO_GAIN
        self._values: dict[str, wire.Value] = {}

    def start_cycles(self) -> None:
        """Choose a random value."""
        self.choose(self.any_value())
        self.exchange_values(self._propose)

    def _propose(self, messages: Mapping[str, wire.Message]) -> None:
        """Draw a value that improves this robot's side, and propose it."""
        self._values = self.checked_values(messages)
        costs = self.problem.lexicographic_costs(self._values)
        self.before = costs[self.present]
        gains = [gain(self.before, cost) for cost in costs]
        self.proposal = self._drawn(gains)
        if self.proposal is not None:
            self.after = costs[self.proposal]
        value = None if self.proposal is None else self.problem.values[self.proposal]
        self.multicast(self.problem.neighbours, Proposal(value))
        self.listen(self.problem.neighbours, self._answer)

    def _drawn(self, gains: Sequence[LexicographicCost]) -> int | None:
        """Return the index of a value with a gain, drawn in proportion to the gain; None if there is none."""
        better = [place for place, saved in enumerate(gains) if saved > NO_GAIN]
        if not better:
            return None
        first = any(gains[place][0] for place in better)
        sums = list(itertools.accumulate(gains[place][0 if first else 1] for place in better))
        lot = self.chance() * sums[-1]
        return next((place for place, total in zip(better, sums, strict=True) if lot < total), better[-1])

    def _answer(self, messages: Mapping[str, wire.Message]) -> None:
        """Send each neighbour with a proposal the costs of this robot's side, now and with the proposed value."""
        for name in self.problem.neighbours:
            message = messages.get(name)
            wanted = message.value if isinstance(message, Proposal) else None
            sides = Sides(NO_GAIN, NO_GAIN)
            if wanted is not None and name in self._values:
                now = self.problem.own_side(self.present, name, self._values[name])
                sides = Sides(now, self.problem.own_side(self.present, name, wanted))
            self.send(name, sides)
        self.listen(self.problem.neighbours, self._decide)

    def _decide(self, messages: Mapping[str, wire.Message]) -> None:
        """Accept the proposal with a probability, if it is cheap enough for both sides together."""
        index = self.present
        if self.proposal is not None and len(messages) == len(self.problem.neighbours):
            sides = [message for message in messages.values() if isinstance(message, Sides)]
            before = _sum([self.before, *(side.now for side in sides)])
            after = _sum([self.after, *(side.proposed for side in sides)])
            if self._cheap(before, after) and self.chance() < self.settings.probability:
                index = self.proposal
        self.choose(index)
        if not self.finished:
            self.exchange_values(self._propose)

    def _cheap(self, before: LexicographicCost, after: LexicographicCost) -> bool:
        """Return whether to accept a proposal that costs `after` instead of `before`."""
        return after[0] < before[0] or (after[0] == before[0] and after[1] * self.settings.coordination < before[1])


def _sum(costs: Sequence[LexicographicCost]) -> LexicographicCost:
    return sum(broken for broken, _ in costs), sum(cost for _, cost in costs)
