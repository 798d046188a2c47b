"""Searches in cycles on shares of all tables and values, for `p_dsa`, `p_mgm` and `p_maxsum`.

After the first cycle no robot knows a value, not even its own: all robots have shares of the codes of all values, and
of all tables of costs, and compute the next codes together. Nothing is opened until the end, when each robot receives
its own value. Each robot shares a table with each robot before it, also if all costs are 0.

Constraints are over at most two robots.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any, ClassVar, NamedTuple

from robochoc.model.outcome import Verdict
from robochoc.protocols.key_stream import shuffled
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.shared_arithmetic import Inputs, Masked, Opened, Output, Randomness
from robochoc.protocols.private.shared_costs import SharedCostsProtocol, Sizes, check_settings
from robochoc.protocols.settings import Settings
from robochoc.solver.local_problem import LocalProblem

MOST_CYCLES = 100_000
PRIVACY = "constraints, domains and values, also from coalitions of a minority"


class SearchSettings(Settings, frozen=True):
    """`cycles`: their number. `comparisons`: their maximum number. `bits`: the field has 2^bits - 1 elements."""

    cycles: int = 20
    comparisons: int = 20_000
    bits: int = 61

    def __post_init__(self) -> None:
        check_settings(self.comparisons, self.bits)
        if not 1 <= self.cycles <= MOST_CYCLES:
            raise ValueError(f"cycles is {self.cycles}; it must be from 1 to {MOST_CYCLES:,}")


class Candidate(NamedTuple):
    """Shares of a cost, and of the code of the value with this cost."""

    cost: int
    code: list[int]


class SharedSearchProtocol(SharedCostsProtocol):
    """One robot of a search in cycles. All lists over robots are in priority order.

    Attributes:
        cycle: The number of the present cycle.
        codes: Shares of the code of each robot's value: 1 for the value, 0 for all others.
        charges: For each robot, shares of the costs of its values alone.
        tables: For each robot, and each robot before it: shares of the table; the values of the latter change fastest.
        further: For each robot, shares of its `further_inputs`.
        value_costs: For each robot, shares of the cost of each of its values, given the present codes (`evaluate`).
        present_costs: Shares of the cost of each robot's present value.
        team_cost: A share of twice the cost of the team.
        least: The best candidate of each group (`find_least`).
        best_codes: The codes in the best cycle, if the protocol replaces them (`best_changes`); else the present ones.
        best_cost: A share of twice the cost of the best cycle.
    """

    messages: ClassVar[Any] = Randomness | Inputs | Masked | Opened | Output | Sizes
    settings: ClassVar[SearchSettings] = SearchSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.cycle = 0
        self.codes: list[list[int]] = []
        self.charges: list[list[int]] = []
        self.tables: list[list[list[int]]] = []
        self.further: list[list[int]] = []
        self.value_costs: list[list[int]] = []
        self.present_costs: list[int] = []
        self.team_cost = 0
        self.least: list[Candidate] = []
        self.best_codes: list[list[int]] = []
        self.best_cost = 0
        self._own_inputs: list[int] = []
        self._groups: list[list[Candidate]] = []

    @property
    def limits(self) -> tuple[int, int]:
        return self.settings.comparisons, self.settings.bits

    @property
    def excluded(self) -> int:
        """The cost of an impossible value, above all broken constraints: they add up to less than p/16."""
        return self.field.prime // 8

    @abstractmethod
    def comparisons_needed(self) -> int:
        """Return the number of comparisons in the whole search."""

    @abstractmethod
    def further_count(self, rank: int) -> int:
        """Return the number of `further_inputs` of a robot."""

    @abstractmethod
    def further_inputs(self) -> list[int]:
        """Return the secrets to share besides the first value and all costs."""

    @abstractmethod
    def start_search(self) -> None:
        """Start the first cycle, with shares of all inputs."""

    def first_place(self) -> int:
        """Return the index of the first value among the declared ones: the start value if it is known, else random."""
        start = self.problem.start
        known = [place for place, index in self.places.items() if index == start]
        return known[0] if known else shuffled([*self.places], self.secret)[0]

    def begin(self) -> None:
        """Share the first value, all costs and the `further_inputs`."""
        if not self.places:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.check_comparisons(self.comparisons_needed())
        size = self.sizes[self.rank]
        first = self.first_place()
        inputs = [*self.alone, *(int(one == first) for one in range(size)), *self.further_inputs()]
        for name, other in zip(self.order.names[: self.rank], self.sizes, strict=False):
            rows = self.rows.get((name,)) or [[0] * other] * size
            inputs += [cost for row in rows for cost in row]
        self._own_inputs = self.share(inputs)
        self.wait_for(Inputs, self.others, "_use_inputs")

    def _use_inputs(self) -> None:
        counts = [
            2 * size + self.further_count(rank) + size * sum(self.sizes[:rank]) for rank, size in enumerate(self.sizes)
        ]
        received = dict(zip(self.others, self.received(), strict=True))
        for rank, (name, size) in enumerate(zip(self.order.names, self.sizes, strict=True)):
            message = received.get(name)
            shares = iter(
                self.field.unpack(message.shares, counts[rank]) if isinstance(message, Inputs) else self._own_inputs
            )
            self.charges.append([*islice(shares, size)])
            self.codes.append([*islice(shares, size)])
            self.further.append([*islice(shares, self.further_count(rank))])
            self.tables.append([[*islice(shares, size * other)] for other in self.sizes[:rank]])
        self.best_codes = self.codes
        self.best_cost = self.field.prime // 4
        self.start_search()

    # Costs

    def evaluate(self, then: str) -> None:
        """Compute the cost of each value, of each present value and of the team. Continue with `then`."""
        self.steps["evaluate"] = then
        sums = [[*charges] for charges in self.charges]
        for later, tables in enumerate(self.tables):
            for earlier, table in enumerate(tables):
                size = self.sizes[earlier]
                for place, code in enumerate(self.codes[later]):
                    row = table[place * size : (place + 1) * size]
                    sums[later][place] += sum(map(int.__mul__, row, self.codes[earlier]))
                    for other, cost in enumerate(row):
                        sums[earlier][other] += cost * code
        self.reduce([one for own in sums for one in own], "_use_value_costs")

    def _use_value_costs(self) -> None:
        costs = iter(self.results)
        self.value_costs = [[*islice(costs, size)] for size in self.sizes]
        present, alone = (
            [sum(map(int.__mul__, own, code)) for own, code in zip(rows, self.codes, strict=True)]
            for rows in (self.value_costs, self.charges)
        )
        self.reduce([*present, sum(present) + sum(alone)], "_use_present_costs")

    def _use_present_costs(self) -> None:
        *self.present_costs, self.team_cost = self.results
        self.go_to("evaluate")

    # The minimum of several costs

    def candidates(self, costs: Sequence[Sequence[int]]) -> list[list[Candidate]]:
        """Return a candidate for each cost of each robot's values."""
        return [
            [Candidate(cost, [int(one == place) for one in range(len(own))]) for place, cost in enumerate(own)]
            for own in costs
        ]

    def find_least(self, groups: list[list[Candidate]], then: str) -> None:
        """Compute the cheapest candidate of each group, the first one of several. Continue with `then`.

        Pairs are compared at once, so each group takes one comparison less than it has candidates.
        """
        self.steps["least"] = then
        self._groups = groups
        self._compare_pairs()

    def _compare_pairs(self) -> None:
        if pairs := self._pairs():
            self.compare([two.cost - one.cost for one, two in pairs], "_choose_in_pairs")
        else:
            self.least = [own[0] for own in self._groups]
            self.go_to("least")

    def _pairs(self) -> list[tuple[Candidate, Candidate]]:
        return [(own[place], own[place + 1]) for own in self._groups for place in range(0, len(own) - 1, 2)]

    def _choose_in_pairs(self) -> None:
        """Compute the better candidate of each pair: the first one, unless the second costs less."""
        pairs = zip(self.results, self._pairs(), strict=True)
        differences = [
            (first, [one.cost - two.cost, *(a - b for a, b in zip(one.code, two.code, strict=True))])
            for first, (one, two) in pairs
        ]
        self.reduce([first * one for first, each in differences for one in each], "_join_pairs")

    def _join_pairs(self) -> None:
        changes, prime = iter(self.results), self.field.prime
        for number, own in enumerate(self._groups):
            joined = []
            for place in range(0, len(own) - 1, 2):
                two = own[place + 1]
                cost = (two.cost + next(changes)) % prime
                joined.append(Candidate(cost, [(one + next(changes)) % prime for one in two.code]))
            self._groups[number] = joined + own[len(own) // 2 * 2 :]
        self._compare_pairs()

    # The best cycle

    @property
    def is_best(self) -> int:
        """A share of a number: not negative if the present cycle costs less than the best one."""
        return self.best_cost - self.team_cost - 1

    def best_changes(self, is_best: int) -> list[int]:
        """Return the products to reduce for `use_best_changes`; `is_best` is a share of 1 or 0."""
        changes = [self.team_cost - self.best_cost]
        for code, best in zip(self.codes, self.best_codes, strict=True):
            changes += [one - other for one, other in zip(code, best, strict=True)]
        return [is_best * change for change in changes]

    def use_best_changes(self, changes: Iterator[int]) -> None:
        """Replace the best cycle by the present one, if it is better."""
        prime = self.field.prime
        self.best_cost = (self.best_cost + next(changes)) % prime
        self.best_codes = [[(one + next(changes)) % prime for one in code] for code in self.best_codes]

    # The end

    def finish(self) -> None:
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
        if place not in self.places:
            raise ValueError(f"the robots computed an impossible value of {self.problem.agent}")
        self.value = self.places[place]


class MovingProtocol(SharedSearchProtocol):
    """A search in which robots move to their best values (`least`)."""

    def move(self, moves: Sequence[int], then: str) -> None:
        """Change the codes of the robots for which `moves` has a share of 1. Continue with `then`."""
        self.steps["move"] = then
        products = [
            moving * (new - old)
            for moving, best, code in zip(moves, self.least, self.codes, strict=True)
            for new, old in zip(best.code, code, strict=True)
        ]
        self.reduce(products, "_use_moves")

    def _use_moves(self) -> None:
        changes, prime = iter(self.results), self.field.prime
        self.codes = [[(one + next(changes)) % prime for one in code] for code in self.codes]
        self.cycle += 1
        self.go_to("move")
