"""Enumerates the solutions of small networks in this process, without starting Java.

A depth-first search that keeps every table arc consistent. The valid rows of a table are stored as a bit set in an
integer, and so are the rows that contain each value; intersecting these sets gives the remaining rows (Demeulenaere,
Hartert, Lecoutre, Perez, Perron, Regin and Schaus, "Compact-Table", CP 2016). The next variable is the one with the
fewest values for its number of constraints (dom/deg: Bessiere and Regin, "MAC and combined heuristics", CP 1996). Costs
are minimised by branch and bound; the bound is the sum of the minimum costs.

The effort is limited in steps, not seconds: whether a network is solved here is the same on every machine. It is not
predicted: the search starts, and stops when the steps are used up.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from robochoc.solver.encoding import Codes, CodeTable, Costs, Network
from robochoc.system.errors import RobochocError

STEPS_EACH = 100_000
"""The maximum number of steps for each task: about as long as a query to a running ACE."""
STEPS_BEFORE_ACE = 1_500_000
"""The additional steps for all tasks together before ACE is started: about as long as its start."""

ROWS_A_STEP = 256
"""The number of table rows that one step covers, for one value. Longer tables and wider domains take more steps."""
PLACES_A_STEP = 4
"""The number of domains and tables that one step copies at every node. This also bounds the memory."""


class OutOfStepsError(RobochocError):
    """The steps are used up before the search is complete."""


class Budget:
    """A maximum number of steps, and the number already `used`."""

    def __init__(self, steps: int) -> None:
        self.steps = steps
        self.used = 0

    def spend(self, steps: int) -> None:
        """Use `steps` more steps. If fewer are left, use these up and raise `OutOfStepsError`."""
        self.used += steps
        if self.used > self.steps:
            self.used = self.steps
            raise OutOfStepsError


class Enumeration(NamedTuple):
    """The number of solutions, whether there are no others, and (unless only counted) the sorted solutions."""

    number: int
    complete: bool
    solutions: list[Codes]


def enumerate_solutions(network: Network, budget: Budget, *, limit: int | None, count_only: bool) -> Enumeration:
    """Return the solutions of a propagated `network`, up to `limit`, in lexicographic order.

    Raises:
        OutOfStepsError: if the budget is too small.
    """
    search = _Search(network, budget)
    solutions: list[Codes] = []
    count = 0
    for found in search.solutions():
        several = found if limit is None else found[: limit + 1 - count]
        count += len(several)
        if not count_only:
            solutions += several
        if limit is not None and count > limit:
            return Enumeration(limit, complete=False, solutions=sorted(solutions)[:limit])
        if count == limit and limit == 1:  # it does not matter whether there are others
            return Enumeration(1, complete=False, solutions=solutions)
    return Enumeration(count, complete=True, solutions=sorted(solutions))


def minimum_solution(network: Network, budget: Budget, costs: Costs) -> Codes | None:
    """Return a solution of a propagated `network` with the least sum of `costs`, if there is one.

    Raises:
        OutOfStepsError: if the budget is too small.
    """
    return _Search(network, budget).cheapest(costs)


class _Search:
    """A search in one network: bit i in a domain means its i-th code, bit i in a table its i-th row."""

    def __init__(self, network: Network, budget: Budget) -> None:
        self._budget = budget
        if network.formulas:
            budget.spend(budget.steps + 1)
        budget.spend(sum(len(domain) * (1 + len(domain) // ROWS_A_STEP) for domain in network.domains))
        self._code = [{1 << index: code for index, code in enumerate(domain)} for domain in network.domains]
        self._bit = [{code: 1 << index for index, code in enumerate(domain)} for domain in network.domains]
        self._tables_at: list[list[tuple[int, int]]] = [[] for _ in network.domains]
        self._apart: list[set[int]] = [set() for _ in network.domains]
        self._scopes = [table.scope for table in network.tables]
        self._weights = [1 + len(table.rows) // ROWS_A_STEP for table in network.tables]
        made: dict[tuple[int, tuple[Codes, ...]], list[dict[int, int]]] = {}
        self._rows: list[list[dict[int, int]]] = []
        for number, table in enumerate(network.tables):
            for index, place in enumerate(table.scope):
                self._tables_at[place].append((number, index))
            alike = id(table.rows), tuple([network.domains[place] for place in table.scope])
            if alike not in made:
                made[alike] = self._by_value(table)
            self._rows.append(made[alike])
        for scope in network.different:
            for place in scope:
                self._apart[place].update(other for other in scope if other != place)
        seen = zip(self._tables_at, self._apart, strict=True)
        self._degrees = [max(1, len(tables) + len(others)) for tables, others in seen]
        self._node_steps = 1 + (len(network.domains) + len(network.tables)) // PLACES_A_STEP
        self._domains = [(1 << len(domain)) - 1 for domain in network.domains]
        self._left = [(1 << len(table.rows)) - 1 for table in network.tables]

    def _by_value(self, table: CodeTable) -> list[dict[int, int]]:
        """Return, for each variable of `table` and each bit in its domain, the rows with that value."""
        if not table.allowed:  # after propagation, such tables have too many allowed rows
            self._budget.spend(self._budget.steps + 1)
        weight = 1 + len(table.rows) // ROWS_A_STEP
        self._budget.spend(sum(len(table.rows) + weight * len(self._bit[place]) for place in table.scope))
        found = []
        for index, place in enumerate(table.scope):
            size = (len(table.rows) + 7) // 8
            rows = {code: bytearray(size) for code in self._bit[place]}
            for number, row in enumerate(table.rows):
                rows[row[index]][number >> 3] |= 1 << (number & 7)
            found.append({self._bit[place][code]: int.from_bytes(bits, "little") for code, bits in rows.items()})
        return found

    def solutions(self) -> Iterator[list[Codes]]:
        """Yield all solutions, several at a time. Raises `OutOfStepsError`."""
        place, bit = 0, self._domains[0]
        stack = [(self._domains, self._left, place, bit)]
        while stack:
            domains, left, place, bit = stack.pop()
            domains, left = [*domains], [*left]  # sibling nodes share the old lists
            domains[place] = bit
            if not self._propagates(domains, left, [place]):
                continue
            place, others = self._next(domains)
            bits = [*_bits(domains[place])]
            if others:
                stack += [(domains, left, place, bit) for bit in reversed(bits)]
            else:  # at most one variable is left, and all its values are consistent
                self._budget.spend(len(domains) * len(bits))
                yield [self._codes(_with(domains, place, bit)) for bit in bits]

    def cheapest(self, costs: Costs) -> Codes | None:
        """Return the first cheapest solution. Raises `OutOfStepsError`."""
        best: Codes | None = None
        least: int | None = None
        stack = [(self._domains, self._left)]
        while stack:
            domains, left = stack.pop()
            if least is not None and not self._below(domains, left, costs, least):
                continue
            place, _ = self._next(domains)
            if _is_one(domains[place]):
                best, least = self._codes(domains), self._bound(domains, costs)
                continue
            children = [(_with(domains, place, bit), [*left]) for bit in _bits(domains[place])]
            alive = [child for child in children if self._propagates(*child, [place])]
            alive.sort(key=lambda child: self._bound(child[0], costs), reverse=True)
            stack += alive
        return best

    def _below(self, domains: list[int], left: list[int], costs: Costs, least: int) -> bool:
        """Return whether a solution may cost less than `least`; remove costs of other solutions from the domains."""
        spare = least - 1 - self._bound(domains, costs)
        if spare < 0:
            return False
        shrunk = []
        for place, unit in costs:
            domain, codes = domains[place], self._code[place]
            most = codes[domain & -domain] + spare // unit
            high = domain
            while high and codes[1 << (high.bit_length() - 1)] > most:
                high ^= 1 << (high.bit_length() - 1)
            if high != domain:
                domains[place] = high
                shrunk.append(place)
        return self._propagates(domains, left, shrunk) and self._bound(domains, costs) < least

    def _bound(self, domains: Sequence[int], costs: Costs) -> int:
        """Return a lower bound on the cost of the variables at `costs`."""
        return sum([unit * self._code[place][domains[place] & -domains[place]] for place, unit in costs])

    def _next(self, domains: Sequence[int]) -> tuple[int, bool]:
        """Return the variable to branch on (dom/deg; the first if all are assigned), and whether others are open."""
        best, least, found = 0, 0.0, 0
        for place, domain in enumerate(domains):
            if domain & (domain - 1):
                found += 1
                size = domain.bit_count() / self._degrees[place]
                if found == 1 or size < least:
                    best, least = place, size
        return best, found > 1

    def _codes(self, domains: Sequence[int]) -> Codes:
        return tuple([codes[domain] for codes, domain in zip(self._code, domains, strict=True)])

    def _propagates(self, domains: list[int], left: list[int], shrunk: Iterable[int]) -> bool:
        """Remove values without support after the domains at `shrunk` shrank. Return False if a domain is empty."""
        self._budget.spend(self._node_steps)
        waiting = dict.fromkeys(shrunk)
        while waiting:
            place, _ = waiting.popitem()
            if _is_one(domains[place]) and not self._removes_fixed_value(domains, place, waiting):
                return False
            for number, index in self._tables_at[place]:
                if not self._revised(domains, left, number, index, waiting):
                    return False
        return True

    def _removes_fixed_value(self, domains: list[int], place: int, waiting: dict[int, None]) -> bool:
        """Remove the single value of the variable at `place` from the variables that must differ from it."""
        code = self._code[place][domains[place]]
        for other in self._apart[place]:
            smaller = domains[other] & ~self._bit[other].get(code, 0)
            if smaller != domains[other]:
                if not smaller:
                    return False
                domains[other] = smaller
                waiting[other] = None
        return True

    def _revised(self, domains: list[int], left: list[int], number: int, index: int, waiting: dict[int, None]) -> bool:
        """Remove rows of table `number` without values of its variable `index`, then values without support."""
        rows, scope = self._rows[number], self._scopes[number]
        kept, steps = 0, 0
        values, domain = rows[index], domains[scope[index]]
        while domain:
            bit = domain & -domain
            domain ^= bit
            kept |= values[bit]
            steps += 1
        kept &= left[number]
        if kept != left[number]:
            left[number] = kept
            for other, place in enumerate(scope):
                if other == index:
                    continue
                domain = smaller = domains[place]
                values = rows[other]
                while domain:
                    bit = domain & -domain
                    domain ^= bit
                    steps += 1
                    if not values[bit] & kept:
                        smaller ^= bit
                if smaller != domains[place]:
                    if not smaller:
                        return False
                    domains[place] = smaller
                    waiting[place] = None
        self._budget.spend(steps * self._weights[number])
        return True


def _is_one(domain: int) -> bool:
    return not domain & (domain - 1)


def _bits(domain: int) -> Iterator[int]:
    """Yield the bits of `domain`, the lowest first."""
    while domain:
        bit = domain & -domain
        domain ^= bit
        yield bit


def _with(domains: Sequence[int], place: int, bit: int) -> list[int]:
    """Return `domains` with only the value `bit` for the variable at `place`."""
    chosen = [*domains]
    chosen[place] = bit
    return chosen
