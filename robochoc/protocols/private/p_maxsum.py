"""P-Max-Sum: Max-Sum on shared secrets, private against every coalition of a minority of the robots.

The search is Max-Sum: functions send the minimum cost of each value (R), variables send the costs of their values in
all other functions (Q), and the value with the lowest sum is chosen. But no robot knows a message, a belief or a value,
not even its own: for each node of the factor graph all robots have shares of its messages, and compute them together.
Nothing is opened until the end, when each robot receives its value in the best cycle.

- **When to use**: as `p-dsa`, on a graph with few cycles.
- **Guarantees**: incomplete; it stops after `cycles` cycles with the best of them, without a proof. On a graph without
  cycles the result is optimal if `preference` decides between equal values, and `split=no`. Robots are assumed to
  follow the protocol (honest but curious), and to have channels that nobody else reads. A coalition of fewer than half
  of the robots learns nothing but its own values at the end.
- **Parameters (`--set`)**: `topology` (`hidden`, the default, or `open`: robots tell with whom they share constraints,
  which takes fewer comparisons), `split` (`yes`: each function becomes two equal halves; default `no`), `preference`
  (the maximum random charge of a value, default 0.01), `cycles` (default 10), `comparisons`, the maximum number of
  comparisons in a run (default 20,000), known before the search, and `bits`, the size of the field 2^bits - 1 (default
  61).
- **References**: Tassa, Grinshpoun, Zivan: "Privacy preserving implementation of the Max-Sum algorithm and its
  variants", JAIR 59, 2017. Only the abstract was available: several robots perform the role of each node, by secret
  sharing. The paper encrypts messages between neighbours; here all robots compute on shares, as in `p-dsa`, which
  resists coalitions of a minority. Max-Sum: Farinelli, Rogers, Petcu, Jennings, AAMAS 2008; splitting: Cohen, Galiki,
  Zivan, AIJ 279, 2020.

Disclosed: the number of each robot's declared values, and the settings; with `topology=open` also who shares a
constraint with whom. Two ends of a run disclose more: a robot without a possible value ends it, and a robot whose costs
are too large for the field refuses it.

Sizes: for each function of two robots with a and b values, each cycle takes 2ab - a - b comparisons for R. Further ones
are for the values: as many for each robot as it has values, less one; and one for the team. With `topology=hidden` each
pair of robots has a function, which costs 0 if they share no constraint.

The equations of Max-Sum:

    R, from function to variable   `_send_r`
    Z, and the value               `_use_r`, `_choose`
    Q, from variable to function   `_use_r`

Choices, and differences from `maxsum`:

- The answer is that of `maxsum` with `damping=0`, and with the same preferences. Damping needs fractions, which would
  need ever larger fields; `split` works like damping.
- Q is shifted so that its first entry is 0, instead of its minimum. This is computed without comparisons, and bounds
  all entries: those of R differ by no more than the entries of their function.
- A broken hard constraint costs more than all finite costs, instead of `inf`; an impossible value more than all broken
  constraints of its robot.
- Preferences are drawn like keys. All costs are multiplied by 2^(bits/4), so that a preference is an integer;
  `preference=0` omits this, for high costs. Of several best values the first declared one is taken.
- Constraints are over at most two robots.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.solver.agent_problem import RunParameters
>>> few = RunParameters(settings={"cycles": "1"})
>>> result = Simulation(queens3d(2), PMaxSum, Concurrent(seed=0), parameters=few).search()
>>> result.metrics.messages["Output"]
12
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, islice
from typing import ClassVar, Literal, NamedTuple

from robochoc.protocols.chance import UNIT
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.shared_search import PRIVACY, Candidate, SearchSettings, SharedSearchProtocol
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem


class PMaxSumSettings(SearchSettings, frozen=True):
    """`topology`: `hidden` or `open`. `split`: two halves of each function. `preference`: its maximum for a value.

    `cycles`, `comparisons`: their numbers. `bits`: the field has 2^bits - 1 elements.
    """

    cycles: int = 10
    topology: Literal["hidden", "open"] = "hidden"
    split: Literal["no", "yes"] = "no"
    preference: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.preference < 1:
            raise ValueError(f"preference is {self.preference:g}; it must be from 0 to below 1")


class Function(NamedTuple):
    """The function of two robots, by rank, and this robot's shares of the Q of their variables to it."""

    earlier: int
    later: int
    q: tuple[list[int], list[int]]


class PMaxSum(SharedSearchProtocol):
    """One agent of P-Max-Sum.

    The `further_inputs` are, for each value, its preferred cost (alone, with the preference), and a barrier: a high
    cost for an impossible value, otherwise 0. The barrier is the first Q.
    """

    traits: ClassVar[Traits] = Traits(
        complete=False,
        concludes=ENDS_WITH_PROOF,
        paper="after Tassa, Grinshpoun, Zivan 2017",
        costs=True,
        n_ary=False,
        encrypted_tables=True,
        secret_keys=True,
        privacy=PRIVACY,
        use_when="as p-dsa, graph with few cycles",
    )
    settings: ClassVar[PMaxSumSettings] = PMaxSumSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.functions: list[Function] = []
        self._preferred: list[int] = []

    @property
    def unit(self) -> int:
        return 1 << self.field.bits // 4 if self.settings.preference else 1

    @property
    def announced_scopes(self) -> Sequence[tuple[str, ...]]:
        return [*self.rows] if self.settings.topology == "open" else ()

    def pairs(self) -> list[tuple[int, int]]:
        """Return the ranks of the robots of each function."""
        robots = range(len(self.sizes))
        if self.settings.topology == "open":
            return [(one, later) for later in robots for (one,) in self.scopes[later]]
        return [*combinations(robots, 2)]

    def comparisons_needed(self) -> int:
        sizes = self.sizes
        by_functions = sum(2 * sizes[one] * sizes[two] - sizes[one] - sizes[two] for one, two in self.pairs())
        return self.settings.cycles * (by_functions + sum(sizes) - len(sizes) + 1) + 1

    def begin(self) -> None:
        """Share the first value, all costs and the `further_inputs`. A value that alone costs `inf` is impossible."""
        for place in [place for place in self.places if self.alone[place] >= self.broken]:
            del self.places[place]
            self.alone[place] = self.excluded
        super().begin()

    def first_place(self) -> int:
        """Return the value with the lowest preferred cost."""
        largest = self.settings.preference * self.unit
        self._preferred = [cost + int(self.secret(53) * UNIT * largest) for cost in self.alone]
        return min(self.places, key=self._preferred.__getitem__)

    def further_count(self, rank: int) -> int:
        return 2 * self.sizes[rank]

    def further_inputs(self) -> list[int]:
        return [
            *self._preferred,
            *(0 if place in self.places else self.excluded for place in range(len(self._preferred))),
        ]

    def start_search(self) -> None:
        barriers = [self._doubled(further[len(further) // 2 :]) for further in self.further]
        self.functions = [Function(one, two, (barriers[one], barriers[two])) for one, two in self.pairs()]
        self._evaluate()

    def _doubled(self, costs: Sequence[int]) -> list[int]:
        """Return costs that do not belong to one half of a function; with `split`, those of a half count 1."""
        return [2 * cost for cost in costs] if self.settings.split == "yes" else [*costs]

    def _evaluate(self) -> None:
        self.evaluate("_compare_best")

    def _compare_best(self) -> None:
        self.compare([self.is_best], "_replace_best")

    def _replace_best(self) -> None:
        (is_best,) = self.results
        self.reduce(self.best_changes(is_best), "_end_cycle")

    def _end_cycle(self) -> None:
        self.use_best_changes(iter(self.results))
        if self.cycle == self.settings.cycles:
            self.finish()
        else:
            self._send_r()

    def _send_r(self) -> None:
        """Compute the minimum cost of each value in each function, first those of the earlier robot."""
        groups = []
        for one, later, (earlier_q, later_q) in self.functions:
            size, table = self.sizes[one], self.tables[later][one]
            rows = [table[at : at + size] for at in range(0, len(table), size)]
            columns = zip(*rows, strict=True)
            for lines, q in ((columns, later_q), (rows, earlier_q)):
                groups += [[Candidate(a + b, []) for a, b in zip(line, q, strict=True)] for line in lines]
        self.find_least(groups, "_use_r")

    def _use_r(self) -> None:
        """Compute the cost of each value in all functions, and without each function."""
        costs = iter([candidate.cost for candidate in self.least])
        r = [
            ([*islice(costs, self.sizes[one])], [*islice(costs, self.sizes[later])]) for one, later, _ in self.functions
        ]
        z = [self._doubled(further[: len(further) // 2]) for further in self.further]
        for (one, later, _), both in zip(self.functions, r, strict=True):
            for rank, row in zip((one, later), both, strict=True):
                z[rank] = [a + b for a, b in zip(z[rank], self._doubled(row), strict=True)]
        self.functions = [
            Function(one, later, (self._without(z[one], both[0]), self._without(z[later], both[1])))
            for (one, later, _), both in zip(self.functions, r, strict=True)
        ]
        self.find_least(self.candidates(z), "_choose")

    def _without(self, z: Sequence[int], r: Sequence[int]) -> list[int]:
        """Return Q: `z` without `r`, the first entry 0."""
        q = [a - b for a, b in zip(z, r, strict=True)]
        return [(one - q[0]) % self.field.prime for one in q]

    def _choose(self) -> None:
        self.codes = [best.code for best in self.least]
        self.cycle += 1
        self._evaluate()
