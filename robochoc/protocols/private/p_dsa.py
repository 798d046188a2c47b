"""P-DSA: DSA on shared secrets, private against every coalition of a minority of the robots.

The search is DSA, variant A: in each cycle, each robot computes its best value given the present values of the others,
and moves to it with a probability if this lowers its cost. But after the first cycle no robot knows a value, not
even its own: all robots have shares of the codes of all values, and of all tables of costs, and compute the next codes
together. Nothing is opened until the end, when each robot receives its value in the best cycle.

- **When to use**: costs, three robots or more that may combine their knowledge, and too many for `pc-syncbb`.
- **Guarantees**: incomplete; it stops after `cycles` cycles with the best of them, without a proof. Robots are assumed
  to follow the protocol (honest but curious), and to have channels that nobody else reads. A coalition of fewer than
  half of the robots learns nothing but its own values at the end.
- **Parameters (`--set`)**: `cycles` (default 20), `probability` of a move (default 0.7), `comparisons`, the maximum
  number of comparisons in a run (default 20,000), known before the search, and `bits`, the size of the field 2^bits - 1
  (default 61).
- **Reference**: Goldklang, Grinshpoun, Tassa: "Privacy preserving solution of DCOPs by local search", IJCAI 2025. Only
  the abstract was available: this follows its principle (DSA by secret sharing). DSA: Zhang, Wang, Xing, Wittenburg,
  AIJ 161, 2005.

Disclosed: the number of each robot's declared values, and the settings. Who shares a constraint with whom is not
disclosed: each robot shares a table with each robot before it, also if all costs are 0. Two ends of a run disclose
more: a robot without a possible value ends it, and a robot whose costs are too large for the field refuses it.

Sizes: each cycle takes one comparison for each value of each robot, and one for the whole team; those that do not
depend on each other are made at once.

The methods:

    shares          `shamir`              products, random numbers   `shared_arithmetic`
    comparison      `shared_comparison`   costs                      `shared_costs`
    a cycle         `evaluate`, `find_least`, `_compare_gains`, `_choose_moves`, `move`

Choices, and differences:

- Constraints are over at most two robots.
- The values of the first cycle and the chances to move are drawn like keys: all robots know the seed of `chance`.
- Of several best values the first declared one is taken.
- The robots also compute the best cycle. The cost of a cycle is that before its moves.
- A broken hard constraint costs more than all finite costs; an impossible value more than all broken constraints.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.solver.agent_problem import RunParameters
>>> few = RunParameters(settings={"cycles": "1"})
>>> result = Simulation(queens3d(2), PDSA, Concurrent(seed=0), parameters=few).search()
>>> result.metrics.messages["Output"]
12
"""

from __future__ import annotations

from itertools import islice
from typing import ClassVar

from robochoc.protocols.chance import UNIT
from robochoc.protocols.private.shared_search import PRIVACY, MovingProtocol, SearchSettings
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits


class PDSASettings(SearchSettings, frozen=True):
    """`probability` of a move. `cycles`, `comparisons`: their numbers. `bits`: the size of the field."""

    probability: float = 0.7

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.probability <= 1:
            raise ValueError(f"probability is {self.probability:g}; it must be more than 0 and at most 1")


class PDSA(MovingProtocol):
    """One agent of P-DSA. The `further_inputs` are the chances to move, one for each cycle."""

    traits: ClassVar[Traits] = Traits(
        complete=False,
        concludes=ENDS_WITH_PROOF,
        paper="Goldklang, Grinshpoun & Tassa 2025",
        costs=True,
        n_ary=False,
        encrypted_tables=True,
        secret_keys=True,
        privacy=PRIVACY,
        use_when="as pc-syncbb, with more robots, without a proof",
    )
    settings: ClassVar[PDSASettings] = PDSASettings()

    def comparisons_needed(self) -> int:
        return self.settings.cycles * (sum(self.sizes) + 1)

    def further_count(self, rank: int) -> int:  # noqa: ARG002 - the same for all robots
        return self.settings.cycles

    def further_inputs(self) -> list[int]:
        return [int(self.secret(53) * UNIT < self.settings.probability) for _ in range(self.settings.cycles)]

    def start_search(self) -> None:
        if self.cycle == self.settings.cycles:
            self.finish()
        else:
            self.evaluate("_find_targets")

    def _find_targets(self) -> None:
        self.find_least(self.candidates(self.value_costs), "_compare_gains")

    def _compare_gains(self) -> None:
        gains = [one - best.cost - 1 for one, best in zip(self.present_costs, self.least, strict=True)]
        self.compare([*gains, self.is_best], "_choose_moves")

    def _choose_moves(self) -> None:
        """Compute who moves: robots that gain, with a coin; and whether the present cycle is the best one."""
        *gaining, is_best = self.results
        moves = [one * coins[self.cycle] for one, coins in zip(gaining, self.further, strict=True)]
        self.reduce([*moves, *self.best_changes(is_best)], "_move")

    def _move(self) -> None:
        changes = iter(self.results)
        moves = [*islice(changes, len(self.sizes))]
        self.use_best_changes(changes)
        self.move(moves, "start_search")
