"""P-MGM: MGM on shared secrets, private against every coalition of a minority of the robots.

The search is MGM: in each cycle, each robot computes its best value given the present values of the others, and moves
to it if its gain is positive and the largest among all robots with which it shares a constraint. But after the first
cycle no robot knows a value or a gain, not even its own: all robots compute them on shares, and nothing is opened until
the end, when each robot receives its value.

- **When to use**: as `p-dsa`, if the cost must never rise. The search ends in a local optimum.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The cost never rises.
  Robots are assumed to follow the protocol (honest but curious), and to have channels that nobody else reads. A
  coalition of fewer than half of the robots learns nothing but its own values at the end.
- **Parameters (`--set`)**: `cycles` (default 20), `comparisons`, the maximum number of comparisons in a run (default
  20,000), known before the search, and `bits`, the size of the field 2^bits - 1 (default 61).
- **References**: MGM: Maheswaran, Pearce, Tambe, PDCS 2004. Private local search with groups of robots: Grinshpoun,
  Tassa, Levit, Zivan: "Privacy preserving region optimal algorithms for symmetric and asymmetric DCOPs", AIJ 266, 2019.
  Only the abstract of the latter was available: this follows the principle of `p-dsa`.

Disclosed: the number of each robot's declared values, and the settings. Who shares a constraint with whom is not
disclosed: all pairs of robots are compared, and a shared secret decides whether the answer counts. Two ends of a run
disclose more: a robot without a possible value ends it, and a robot whose costs are too large for the field refuses it.

Sizes: each cycle takes one comparison for each value of each robot, and one for each pair of robots; those that do not
depend on each other are made at once.

The methods:

    BestUnilateralGain                 `evaluate`, `find_least`
    if gain > max(neighbours' gains)   `_compare_gains`, `_use_answers`, `_choose_moves`, `_join_factors`

Choices:

- The first value is the start value if it is known, otherwise it is drawn like a key.
- Of several best values the first declared one is taken. Of several neighbours with the same gain the first in the
  order moves.
- Constraints are over at most two robots.
- A broken hard constraint costs more than all finite costs; an impossible value more than all broken constraints.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.solver.agent_problem import RunParameters
>>> few = RunParameters(settings={"cycles": "1"})
>>> result = Simulation(queens3d(2), PMGM, Concurrent(seed=0), parameters=few).search()
>>> result.metrics.messages["Output"]
12
"""

from __future__ import annotations

from itertools import combinations
from typing import ClassVar

from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.shared_search import PRIVACY, MovingProtocol
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem


class PMGM(MovingProtocol):
    """One agent of P-MGM. The `further_inputs` are 1 for each robot before it that shares a constraint, otherwise 0."""

    traits: ClassVar[Traits] = Traits(
        complete=False,
        concludes=ENDS_WITH_PROOF,
        paper="after Maheswaran, Pearce, Tambe 2004",
        costs=True,
        n_ary=False,
        encrypted_tables=True,
        secret_keys=True,
        privacy=PRIVACY,
        use_when="as p-dsa, and the cost never rises; ends in a local optimum",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self._factors: list[list[int]] = []
        """For each robot, shares of numbers: 1 if it may move as far as one or several others are concerned, else 0."""

    def comparisons_needed(self) -> int:
        robots = len(self.sizes)
        return self.settings.cycles * (sum(self.sizes) + robots * (robots - 1) // 2)

    def further_count(self, rank: int) -> int:
        return rank

    def further_inputs(self) -> list[int]:
        return [int(name in self.problem.neighbours) for name in self.order.names[: self.rank]]

    def start_search(self) -> None:
        if self.cycle == self.settings.cycles:
            self.best_codes = self.codes
            self.finish()
        else:
            self.evaluate("_find_targets")

    def _find_targets(self) -> None:
        self.find_least(self.candidates(self.value_costs), "_compare_gains")

    def _compare_gains(self) -> None:
        gains = [one - best.cost for one, best in zip(self.present_costs, self.least, strict=True)]
        self.compare([*(one - 1 for one in gains), *(one - two for one, two in combinations(gains, 2))], "_use_answers")

    def _use_answers(self) -> None:
        """Compute, for each pair of robots, a share of 1 if they share a constraint and the first one gains as much."""
        robots = len(self.sizes)
        self._factors = [[gains] for gains in self.results[:robots]]
        pairs = combinations(range(robots), 2)
        self.reduce(
            [self.further[later][one] * wins for (one, later), wins in zip(pairs, self.results[robots:], strict=True)],
            "_choose_moves",
        )

    def _choose_moves(self) -> None:
        """A robot may move if it gains, and wins against each robot that shares a constraint with it."""
        for (one, later), wins in zip(combinations(range(len(self.sizes)), 2), self.results, strict=True):
            self._factors[one].append(1 - self.further[later][one] + wins)
            self._factors[later].append(1 - wins)
        self._join_factors()

    def _join_factors(self) -> None:
        """Multiply the factors of each robot, pairs of them at once."""
        if len(self._factors[0]) == 1:
            self.move([moves for (moves,) in self._factors], "start_search")
            return
        pairs = [(own[at], own[at + 1]) for own in self._factors for at in range(0, len(own) - 1, 2)]
        self.reduce([one * two for one, two in pairs], "_use_joined_factors")

    def _use_joined_factors(self) -> None:
        joined = iter(self.results)
        self._factors = [
            [next(joined) for _ in range(len(own) // 2)] + own[len(own) // 2 * 2 :] for own in self._factors
        ]
        self._join_factors()
