"""The Distributed Stochastic Algorithm (DSA), variants A to E.

Local search in cycles. In each cycle a robot finds its best value given its neighbours' values in the previous cycle,
and chooses it with a probability, so that not all neighbours move at once. The gain is the cost that a move saves.
Variant A moves only if it gains. B also moves if it gains nothing and is in conflict. C also moves if it gains nothing
at all. D and E are B and C in which a robot that gains always moves.

- **When to use**: costs, a large team: good results fast.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The result is the best
  cycle (anytime). A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `variant` (A to E; default B), `probability` (p; default 0.7), `cycles` (default 100). B
  was the best of A, B and C on colouring problems (Zhang and others): sideways moves leave plateaus, and it settles
  where there is no conflict.
- **References**: Fitzpatrick, Meertens: "An experimental assessment of a stochastic, anytime, decentralized, soft
  colourer for sparse graphs", SAGA 2001; Zhang, Wang, Xing, Wittenburg: "Distributed stochastic search and distributed
  breakout: properties, comparison and applications to constraint optimization problems in sensor networks", AIJ 161,
  2005, Section 3.

Algorithm 1 in the paper, line by line:

    randomly choose a value                                        `start_cycles`
    while no termination condition is met: send the value, if      `exchange_values`
      it is new, collect neighbours' new values
    select and assign the next value (Table 1)                     `choice`

Choices that the paper leaves open, and differences:

- The value is sent in each cycle, even if it has not changed, so that neighbours know that the cycle is over.
- A robot is in conflict when a shared constraint is violated or has any cost.
- Constraints may be n-ary; each robot in a scope counts the whole cost of the constraint.
- Fewer violated hard constraints are always better.
- If there are several best values, one is chosen at random.
- If a message is lost, the neighbour's last known value is used.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), DSA, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Value': 15200}
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

from robochoc.protocols.message import Message
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import NO_GAIN, CycleProtocol, CycleSettings, Value, gain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LexicographicCost
from robochoc.system.compiling import mypyc_attr


class DSASettings(CycleSettings, frozen=True):
    """`variant`: A, B, C, D or E. `probability` (p): the probability of a move. `cycles`: the number of cycles."""

    variant: Literal["A", "B", "C", "D", "E"] = "B"
    probability: float = 0.7

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.probability <= 1:
            raise ValueError(f"probability is {self.probability:g}; it must be more than 0 and at most 1")


@mypyc_attr(allow_interpreted_subclasses=True)
class OnePhase(CycleProtocol):
    """The common base of searches with one phase: all robots send their values, and each chooses its next value."""

    def start_cycles(self) -> None:
        """Choose a random value."""
        self.choose(self.any_value())
        self.exchange_values(self._choose)

    @abstractmethod
    def choice(self, costs: Sequence[LexicographicCost]) -> int:
        """Return this robot's value for the next cycle, given the cost of each of its values."""

    def _choose(self, messages: Mapping[str, Message]) -> None:
        """Move or stay, once all neighbours' values are known."""
        self.choose(self.choice(self.problem.lexicographic_costs(self.checked_values(messages))))
        if not self.finished:
            self.exchange_values(self._choose)


@mypyc_attr(allow_interpreted_subclasses=True)
class StochasticSearch(OnePhase):
    """The common base of DSA and its variants: each robot moves with some probability."""

    @abstractmethod
    def proposal(self, costs: Sequence[LexicographicCost]) -> tuple[list[int], float]:
        """Return the candidate values, given the cost of each of this robot's values, and the probability of a move."""

    def choice(self, costs: Sequence[LexicographicCost]) -> int:
        """Return one of the proposed values with their probability, otherwise the present value."""
        places, probability = self.proposal(costs)
        if places and probability and self.chance() < probability:
            return self.any_of(places)
        return self.present

    def places_of(self, cost: LexicographicCost, costs: Sequence[LexicographicCost]) -> list[int]:
        """Return the values other than the present one whose cost is `cost`."""
        return [place for place, other in enumerate(costs) if other == cost and place != self.present]

    def in_conflict(self, now: LexicographicCost) -> bool:
        """Return whether a shared constraint is violated or has a cost, if the present value costs `now`."""
        return now != (0, self.problem.charges[self.present])


@mypyc_attr(allow_interpreted_subclasses=True)
class DSA(StochasticSearch):
    """One agent of DSA. A cycle has one phase: all robots send their values."""

    messages: ClassVar[Any] = Value | AnytimeMessage
    settings: ClassVar[DSASettings] = DSASettings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Fitzpatrick & Meertens 2001; Zhang, Wang, Xing, Wittenburg 2005",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        arrays=True,
        privacy="constraints among others",
        use_when="costs, large team: good answers fast, no proof",
    )

    def proposal(self, costs: Sequence[LexicographicCost]) -> tuple[list[int], float]:
        """Return the best values, and the probability for this variant (Table 1)."""
        now, least = costs[self.present], min(costs)
        return self.places_of(least, costs), self._probability(now, least)

    def _probability(self, now: LexicographicCost, least: LexicographicCost) -> float:
        variant, probability = self.settings.variant, self.settings.probability
        if gain(now, least) > NO_GAIN:
            return 1 if variant in "DE" else probability
        return probability if variant in "CE" or (variant in "BD" and self.in_conflict(now)) else 0
