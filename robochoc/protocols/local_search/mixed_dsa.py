"""DSA for hard and soft constraints (MixedDSA).

DSA with separate probabilities for hard and soft constraints. A robot compares its values by the number of hard
constraints that they violate, then by the cost of all other constraints. A move that reduces this number is made with
one probability, a move that only saves cost with another. So the team can satisfy its hard constraints quickly, and
reduce its costs with care.

- **When to use**: hard and soft constraints together, a large team.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The result is the best
  cycle (anytime). A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `hard` (the probability of a move if hard constraints are violated; default 0.7), `soft`
  (the probability of any other move; default 0.5), `variant` (A, B or C as in `dsa`; default B), `cycles` (default
  100).
- **References**: this variant comes from the library pyDcop (Rust, Picard, Ramparany: "Using message-passing DCOP
  algorithms to solve energy-efficient smart environment configuration problems", IJCAI 2016, where devices have hard
  and soft constraints). For DSA: Zhang, Wang, Xing, Wittenburg: "Distributed stochastic search and distributed
  breakout: properties, comparison and applications to constraint optimization problems in sensor networks", AIJ 161,
  2005.

The rules, depending on how the best value compares with the present one:

    fewer hard constraints violated              move with probability `hard`
    as many, but cheaper                         `soft`
    no better, hard constraints violated         `hard` (variants B and C)
    no better, some other constraint charges     `soft` (variants B and C)
    no better, nothing charges                   `soft` (variant C)

A constraint is hard for a combination of values that breaks it (`inf`), and soft for a combination to which it assigns
a cost; the same constraint may be both. First values are random, and constraints may be n-ary, as in `dsa`.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), MixedDSA, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Value': 5600}
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

from robochoc.protocols.local_search.dsa import StochasticSearch
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleSettings, Value, gain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LexicographicCost
from robochoc.system.compiling import mypyc_attr


class MixedDSASettings(CycleSettings, frozen=True):
    """`hard`: the probability of a move if hard constraints are violated. `soft`: the probability of any other move.

    `variant`: A, B or C. `cycles`: the number of cycles.
    """

    hard: float = 0.7
    soft: float = 0.5
    variant: Literal["A", "B", "C"] = "B"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("hard", "soft"):
            if not 0 < getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name):g}; it must be more than 0 and at most 1")


@mypyc_attr(allow_interpreted_subclasses=True)
class MixedDSA(StochasticSearch):
    """One agent of MixedDSA. A cycle has one phase: all robots send their values."""

    messages: ClassVar[Any] = Value | AnytimeMessage
    settings: ClassVar[MixedDSASettings] = MixedDSASettings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Zhang, Wang, Xing, Wittenburg 2005; Rust, Picard, Ramparany 2016",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        use_when="as DSA, hard and soft constraints together",
    )

    def proposal(self, costs: Sequence[LexicographicCost]) -> tuple[list[int], float]:
        """Return the best values, and the probability that belongs to the resulting change."""
        now, least = costs[self.present], min(costs)
        return self.places_of(least, costs), self._probability(now, least)

    def _probability(self, now: LexicographicCost, least: LexicographicCost) -> float:
        fewer, saved = gain(now, least)
        if fewer or saved:
            return self.settings.hard if fewer else self.settings.soft
        if self.settings.variant == "A" or (self.settings.variant == "B" and not self.in_conflict(now)):
            return 0
        return self.settings.hard if now[0] else self.settings.soft
