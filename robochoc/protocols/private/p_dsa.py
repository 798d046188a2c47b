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
    a cycle         `_start_cycle`, `_use_costs`, `_join_best`, `_compare`, `_move`, `_keep_best`

Choices, and differences:

- Constraints are over at most two robots.
- The values of the first cycle and the chances to move are drawn like keys: all robots know the seed of `chance`.
- If the best cycle has an impossible value of a robot, the robot takes its first possible value.
- Of several best values the first declared one is taken.
- The robots also compute the best cycle. The cost of a cycle is that before its moves.
- Broken hard constraints cost 2^w each, more than all finite costs.

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

from collections.abc import Sequence
from itertools import islice
from typing import Any, ClassVar, NamedTuple

from robochoc.model.outcome import Verdict
from robochoc.protocols.chance import UNIT
from robochoc.protocols.key_stream import shuffled
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.shared_arithmetic import Inputs, Masked, Opened, Output, Randomness
from robochoc.protocols.private.shared_costs import SharedCostsProtocol, Sizes, check_settings
from robochoc.protocols.settings import Settings
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem

MOST_CYCLES = 100_000


class PDSASettings(Settings, frozen=True):
    """`cycles`: their number. `probability` of a move. `comparisons`: their maximum number. `bits`: of the field."""

    cycles: int = 20
    probability: float = 0.7
    comparisons: int = 20_000
    bits: int = 61

    def __post_init__(self) -> None:
        check_settings(self.comparisons, self.bits)
        if not 1 <= self.cycles <= MOST_CYCLES:
            raise ValueError(f"cycles is {self.cycles}; it must be from 1 to {MOST_CYCLES:,}")
        if not 0 < self.probability <= 1:
            raise ValueError(f"probability is {self.probability:g}; it must be more than 0 and at most 1")


class Candidate(NamedTuple):
    """Shares of a cost of a robot, and of the code of the value with this cost."""

    cost: int
    code: list[int]


class PDSA(SharedCostsProtocol):
    """One agent of P-DSA.

    State: the number of the present `cycle`; shares of the codes of all robots' values (`codes`), and of those in the
    best cycle (`best_codes`) with its cost (`best_cost`, twice the cost); shares of all tables.
    """

    messages: ClassVar[Any] = Randomness | Inputs | Masked | Opened | Output | Sizes
    traits: ClassVar[Traits] = Traits(
        complete=False,
        concludes=ENDS_WITH_PROOF,
        paper="Goldklang, Grinshpoun & Tassa 2025",
        costs=True,
        n_ary=False,
        encrypted_tables=True,
        secret_keys=True,
        privacy="constraints, domains and values, also from coalitions of a minority",
        use_when="as pc-syncbb, with more robots, without a proof",
    )
    settings: ClassVar[PDSASettings] = PDSASettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.cycle = 0
        self.codes: list[list[int]] = []
        self.best_codes: list[list[int]] = []
        self.best_cost = 0
        self._own_inputs: list[int] = []
        self._charges: list[list[int]] = []
        self._coins: list[list[int]] = []
        self._tables: list[list[list[int]]] = []
        """For each robot, and each robot before it: shares of the table; the values of the latter change fastest."""
        self._costs: list[int] = []
        self._total = 0
        self._candidates: list[list[Candidate]] = []

    @property
    def limits(self) -> tuple[int, int]:
        return self.settings.comparisons, self.settings.bits

    def begin(self) -> None:
        """Share a random value, all costs and the chances to move."""
        if not self.places:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.check_comparisons(self.settings.cycles * (sum(self.sizes) + 1))
        size = self.sizes[self.rank]
        start = self.problem.start
        places = {index: place for place, index in self.places.items()}
        place = shuffled([*self.places], self.secret)[0] if start not in places else places[start]
        inputs = [*self.alone, *(int(one == place) for one in range(size))]
        inputs += [int(self.secret(53) * UNIT < self.settings.probability) for _ in range(self.settings.cycles)]
        for name, other in zip(self.order.names[: self.rank], self.sizes, strict=False):
            rows = self.rows.get((name,)) or [[0] * other] * size
            inputs += [cost for row in rows for cost in row]
        self._own_inputs = self.share(inputs)
        self.wait_for(Inputs, self.others, "_use_inputs")

    def _use_inputs(self) -> None:
        counts = [
            2 * size + self.settings.cycles + size * sum(self.sizes[:rank]) for rank, size in enumerate(self.sizes)
        ]
        received = dict(zip(self.others, self.received(), strict=True))
        for rank, (name, size) in enumerate(zip(self.order.names, self.sizes, strict=True)):
            message = received.get(name)
            shares = iter(
                self.field.unpack(message.shares, counts[rank]) if isinstance(message, Inputs) else self._own_inputs
            )
            self._charges.append([*islice(shares, size)])
            self.codes.append([*islice(shares, size)])
            self._coins.append([*islice(shares, self.settings.cycles)])
            self._tables.append([[*islice(shares, size * other)] for other in self.sizes[:rank]])
        self.best_codes = self.codes
        self.best_cost = self.field.prime // 4
        self._start_cycle()

    # A cycle

    def _start_cycle(self) -> None:
        """Compute the cost of each value of each robot, given the present values of the others."""
        if self.cycle == self.settings.cycles:
            self._finish()
            return
        sums = [[*charges] for charges in self._charges]
        for later, tables in enumerate(self._tables):
            for earlier, table in enumerate(tables):
                size = self.sizes[earlier]
                for place, code in enumerate(self.codes[later]):
                    row = table[place * size : (place + 1) * size]
                    sums[later][place] += sum(map(int.__mul__, row, self.codes[earlier]))
                    for other, cost in enumerate(row):
                        sums[earlier][other] += cost * code
        self.reduce([one % self.field.prime for own in sums for one in own], "_use_costs")

    def _use_costs(self) -> None:
        """Compute each robot's present cost, and the cost of the team; then compare pairs of values."""
        costs = iter(self.results)
        by_robot = [[*islice(costs, size)] for size in self.sizes]
        self._candidates = [
            [Candidate(cost, [int(one == place) for one in range(len(own))]) for place, cost in enumerate(own)]
            for own in by_robot
        ]
        present = [sum(map(int.__mul__, own, code)) for own, code in zip(by_robot, self.codes, strict=True)]
        alone = sum(sum(map(int.__mul__, own, code)) for own, code in zip(self._charges, self.codes, strict=True))
        self.reduce([one % self.field.prime for one in (*present, sum(present) + alone)], "_use_present")

    def _use_present(self) -> None:
        *self._costs, self._total = self.results
        self._compare_pairs()

    def _pairs(self) -> list[tuple[Candidate, Candidate]]:
        """Return the pairs of candidates to be compared at once, of all robots."""
        return [(own[place], own[place + 1]) for own in self._candidates for place in range(0, len(own) - 1, 2)]

    def _compare_pairs(self) -> None:
        if pairs := self._pairs():
            self.compare([two.cost - one.cost for one, two in pairs], "_choose_in_pairs")
        else:
            best = [own[0].cost for own in self._candidates]
            gains = [one - other - 1 for one, other in zip(self._costs, best, strict=True)]
            self.compare([*gains, self.best_cost - self._total - 1], "_move")

    def _choose_in_pairs(self) -> None:
        """Compute the better candidate of each pair: the first one, unless the second costs less."""
        first = self.results
        products = [
            factor * difference
            for factor, (one, two) in zip(first, self._pairs(), strict=True)
            for difference in self._differences(one, two)
        ]
        self.reduce([one % self.field.prime for one in products], "_join_best")

    @staticmethod
    def _differences(one: Candidate, two: Candidate) -> list[int]:
        return [one.cost - two.cost, *(a - b for a, b in zip(one.code, two.code, strict=True))]

    def _join_best(self) -> None:
        changes, prime = iter(self.results), self.field.prime
        for number, own in enumerate(self._candidates):
            joined = []
            for place in range(0, len(own) - 1, 2):
                two = own[place + 1]
                cost = (two.cost + next(changes)) % prime
                joined.append(Candidate(cost, [(one + next(changes)) % prime for one in two.code]))
            self._candidates[number] = joined + own[len(own) // 2 * 2 :]
        self._compare_pairs()

    def _move(self) -> None:
        """Compute who moves: robots that gain, with a coin; and whether the present cycle is the best one."""
        *gaining, is_best = self.results
        coins = [own[self.cycle] for own in self._coins]
        products = [one * coin for one, coin in zip(gaining, coins, strict=True)]
        products += [is_best * (self._total - self.best_cost)]
        for code, best in zip(self.codes, self.best_codes, strict=True):
            products += [is_best * (one - other) for one, other in zip(code, best, strict=True)]
        self.reduce([one % self.field.prime for one in products], "_keep_best")

    def _keep_best(self) -> None:
        prime = self.field.prime
        changes = iter(self.results)
        moving = [*islice(changes, len(self.sizes))]
        self.best_cost = (self.best_cost + next(changes)) % prime
        self.best_codes = [[(one + next(changes)) % prime for one in code] for code in self.best_codes]
        products = [
            moves * (new - old) % prime
            for moves, own, code in zip(moving, self._candidates, self.codes, strict=True)
            for new, old in zip(own[0].code, code, strict=True)
        ]
        self.reduce(products, "_end_cycle")

    def _end_cycle(self) -> None:
        changes = iter(self.results)
        self.codes = [[(one + next(changes)) % self.field.prime for one in code] for code in self.codes]
        self.cycle += 1
        self._start_cycle()

    # The end

    def _finish(self) -> None:
        """Open to each robot its value in the best cycle."""
        for name, code in zip(self.order.names, self.best_codes, strict=True):
            if name != self.problem.agent:
                self.send(name, Output(self.field.pack([self._index(code)])))
        self.wait_for(Output, self.others, "_use_outputs")

    def _index(self, code: Sequence[int]) -> int:
        return sum(place * one for place, one in enumerate(code)) % self.field.prime

    def _use_outputs(self) -> None:
        shares = self.received_shares(1)
        shares.insert(self.rank, [self._index(self.best_codes[self.rank])])
        (place,) = self.field.combine(shares)
        self.value = self.places.get(place, next(iter(self.places.values())))
