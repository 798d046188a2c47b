"""DSA with slope-dependent probabilities (DSA-SDP).

DSA in which the probability of a move depends on its gain: the larger the part of its cost that a robot saves, the
likelier it moves. In every `period`-th cycle all robots explore: robots without a gain may also choose the best of
their other values; the less this raises their cost, the likelier they do so. So the search leaves local optima, and the
best cycle counts.

- **When to use**: like DSA, if there is time for many cycles.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The result is the best
  cycle (anytime); costs rise when robots explore. A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `pa` and `pb` (a robot that saves the part r of its cost moves with probability
  pa + min(pb, r); defaults 0.6 and 0.15), `pc` and `pd` (in a cycle of exploration, a robot whose cost would rise by
  the part r of it moves with probability max(pc, pd - r), and never if r > 1; defaults 0.4 and 0.8), `period` (the
  paper's k; default 40), `cycles` (default 100).
- **References**: Zivan, Okamoto, Peled: "Explorative anytime local search for distributed constraint optimization",
  AIJ 212, 2014, Section 5.

The rules:

    slope-dependent probability of an improvement    `_improving`
    slope-dependent probability of exploration       `_exploring`
    explore every k cycles                           `_explores`

Choices that the paper leaves open, and differences:

- Costs are pairs as in `mgm`, broken hard constraints first. If the move changes their number, r is a part of this
  number, otherwise of the costs.
- A robot without costs has nothing to save, and does not explore either, because any rise would be more than its whole
  cost.
- A robot explores only if its best other value saves nothing. If there are several such values, one is chosen at
  random.
- First values are random, and constraints may be n-ary, as in `dsa`.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), DSASDP, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Value': 5600}
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from robochoc.protocols.local_search.dsa import StochasticSearch
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import NO_GAIN, CycleSettings, Value, gain
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LexicographicCost
from robochoc.system.compiling import mypyc_attr


class DSASDPSettings(CycleSettings, frozen=True):
    """`pa`, `pb`: a move that saves the part r of the robot's cost has the probability pa + min(pb, r).

    `pc`, `pd`: a move that costs the part r more, in a cycle of exploration, has the probability max(pc, pd - r).
    `period`: the number of cycles from one exploration to the next. `cycles`: the number of cycles.
    """

    pa: float = 0.6
    pb: float = 0.15
    pc: float = 0.4
    pd: float = 0.8
    period: int = 40

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("pa", "pb", "pc", "pd"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name):g}; it must be from 0 to 1")
        if self.pa + self.pb > 1:
            raise ValueError(f"pa + pb is {self.pa + self.pb:g}; it must be at most 1")
        if self.period < 1:
            raise ValueError(f"period is {self.period}; it must be 1 or more")


@mypyc_attr(allow_interpreted_subclasses=True)
class DSASDP(StochasticSearch):
    """One agent of DSA-SDP. A cycle has one phase: all robots send their values."""

    messages: ClassVar[Any] = Value | AnytimeMessage
    settings: ClassVar[DSASDPSettings] = DSASDPSettings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Zivan, Okamoto, Peled 2014",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        use_when="as DSA, and many cycles: it explores",
    )

    def proposal(self, costs: Sequence[LexicographicCost]) -> tuple[list[int], float]:
        """Return the best other values, and the probability that belongs to their gain."""
        now = costs[self.present]
        best = min((cost for place, cost in enumerate(costs) if place != self.present), default=None)
        if best is None:
            return [], 0
        saved = gain(now, best)
        if saved > NO_GAIN:
            probability = self._improving(now, saved)
        else:
            probability = self._exploring(now, gain(best, now)) if self._explores else 0
        return self.places_of(best, costs), probability

    def _improving(self, now: LexicographicCost, saved: LexicographicCost) -> float:
        """Return the probability of a move that saves cost."""
        return self.settings.pa + min(self.settings.pb, _part(saved, now))

    def _exploring(self, now: LexicographicCost, lost: LexicographicCost) -> float:
        """Return the probability of a move that saves nothing."""
        part = _part(lost, now)
        return 0 if part > 1 else max(self.settings.pc, self.settings.pd - part)

    @property
    def _explores(self) -> bool:
        """True if the next cycle is a cycle of exploration."""
        return (self.cycle + 1) % self.settings.period == 0


def _part(difference: LexicographicCost, now: LexicographicCost) -> float:
    """Return `difference` as a part of `now`; infinite if `now` is zero."""
    changed, total = (difference[0], now[0]) if difference[0] else (difference[1], now[1])
    return changed / total if total else float("inf")
