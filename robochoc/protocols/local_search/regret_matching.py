"""Regret matching: plain (RM), clipped (RM+), and weighted with inertia (WRM-I).

Local search in cycles. The regret of a value is the cost that a robot would have saved so far with this value instead
of the values that it had, given its neighbours' values at the time. In each cycle a robot draws a value with a
probability proportional to its regret, if that is positive. So it prefers values that would have paid off over many
cycles, not only in the last cycle.

- **When to use**: like `dsa`, if there is time for thirty cycles or more.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The result is the best
  cycle (anytime); costs rise and fall. A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `variant` (rm or rm+; default rm+), `weight` (the fading memory rho: the weight of the
  latest cycle in the regret, where all earlier cycles together have the rest; 0: all cycles have the same weight;
  default 0.1), `inertia` (the probability to keep the value in spite of regrets; default 0.1), `cycles` (default 100).
- **References**: Hart, Mas-Colell: "A simple adaptive procedure leading to correlated equilibrium", Econometrica 68,
  2000 (regret matching); Marden, Arslan, Shamma: "Regret based dynamics: convergence in weakly acyclic games",
  AAMAS 2007 (fading memory and inertia); Chapman, Rogers, Jennings, Leslie: "A unifying framework for iterative
  approximate best-response algorithms for distributed constraint optimization problems", Knowledge Engineering Review
  26, 2011 (WRM-I); Tammelin: "Solving large imperfect information games using CFR+", 2014 (RM+).

The rules, where u is the cost of a value given the neighbours' values of the previous cycle:

    regret(k) <- (1 - rho) regret(k) + rho (u(now) - u(k))    `_update_regrets`
    rm+: max(regret(k), 0) instead                            `_update_regrets`
    draw k in proportion to max(regret(k), 0)                 `_draw`
    inertia; no positive regret: keep the value               `choice`

Choices that the papers leave open, and differences:

- Regrets are unconditional: one for each value, not one for each pair of a value and its substitute. They compare with
  the robot's actual value, as in Hart and Mas-Colell, not with the mean of the values that it might have drawn.
- A robot without a positive regret keeps its value, as in the paper of Marden and others. So a local optimum is kept,
  once all robots have learnt it.
- A broken hard constraint costs 1 more than this robot's most expensive value so far, not counting broken constraints.
- Regrets are integers, in units of 1/65,536 of a cost, so nothing depends on a machine's rounding. Values are rounded
  down.
- First values are random, and constraints may be n-ary, as in `dsa`.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), RegretMatching, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Value': 5600}
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import ClassVar, Literal

from robochoc.protocols.local_search.dsa import OnePhase
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleSettings, Value
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LexicographicCost, LocalProblem


class RegretMatchingSettings(CycleSettings, frozen=True):
    """`variant`: rm, or rm+, in which regrets never fall below 0.

    `weight` (rho): the part of a regret that comes from the last cycle; 0: all cycles count alike. `inertia`: the
    probability that a robot keeps its value in spite of regrets. `cycles`: the number of cycles.
    """

    variant: Literal["rm", "rm+"] = "rm+"
    weight: float = 0.1
    inertia: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.weight <= 1:
            raise ValueError(f"weight is {self.weight:g}; it must be from 0 to 1")
        if not 0 <= self.inertia < 1:
            raise ValueError(f"inertia is {self.inertia:g}; it must be 0 or more, and less than 1")


UNIT = 1 << 16
"""The integer that represents a regret of one cost; integers then represent fractions exactly."""

CHANCES = 1 << 53
"""Random numbers are multiples of 1 / CHANCES."""


class RegretMatching(OnePhase):
    """One agent of regret matching. A cycle has one phase: all robots send their values.

    `regrets`: for each of this robot's values, the cost that it would have saved, in units of 1/65,536.
    """

    messages = Value | AnytimeMessage
    settings: ClassVar[RegretMatchingSettings] = RegretMatchingSettings()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Hart & Mas-Colell 2000; Chapman, Rogers, Jennings, Leslie 2011",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        use_when="as DSA: it follows what has paid over many cycles",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.regrets = [0] * len(problem.values)
        self._most = 0
        """The highest cost of any value so far; a broken constraint counts for 1 more."""

    def choice(self, costs: Sequence[LexicographicCost]) -> int:
        """Return a value drawn by its regret; the present value by inertia, or if there is no positive regret."""
        self._most = max(self._most, *(int(cost) for _, cost in costs))
        self._update_regrets([broken * (self._most + 1) + int(cost) for broken, cost in costs])
        regrets = [max(regret, 0) for regret in self.regrets]
        if not any(regrets) or self.chance() < self.settings.inertia:
            return self.present
        return self._draw(regrets)

    def value_notes(self, index: int) -> Mapping[str, float]:
        """Return the regret of the value at `index`, for a replay."""
        return {"regret": self.regrets[index] / UNIT}

    def _update_regrets(self, costs: Sequence[int]) -> None:
        """Add to each value's regret its saving in this cycle, given the cost of each of this robot's values."""
        now = costs[self.present]
        weight = round(self.settings.weight * UNIT)
        clipped = self.settings.variant == "rm+"
        for place, cost in enumerate(costs):
            before, saved = self.regrets[place], (now - cost) * UNIT
            regret = before + ((saved - before) * weight // UNIT if weight else saved)
            self.regrets[place] = max(regret, 0) if clipped else regret

    def _draw(self, regrets: Sequence[int]) -> int:
        """Return a random index, each with a probability proportional to its regret."""
        sums = list(accumulate(regrets))
        point = int(self.chance() * CHANCES) * sums[-1] // CHANCES
        return bisect_right(sums, point)
