"""Generalised arc consistency on tables, which makes the tables smaller and safe for ACE.

ACE 2.6 counts wrongly if a table of forbidden tuples has a variable with one value, fails an assertion if its first
propagation empties a table, and fails on small permutations (`tests/unit/solver/test_ace.py`;
docs/explanation/design/solving.md, "ACE"). So values without support, variables with one value, and tables without
effect are removed, and small permutations become tables.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

from robochoc.solver.encoding import MAX_ALLOWED_ROWS, Codes, CodeTable, Network
from robochoc.solver.linear import FALSE, Formula, Operand, conjuncts, holds, operands, renamed

LARGEST_PERMUTATION = 5
"""The largest permutation that becomes a table (120 rows). ACE's own limit is 4 variables."""


def propagate(network: Network) -> Network:
    """Return an equivalent arc consistent network; `impossible` if this proves that there is no solution.

    Every variable in a table or a `different` has at least two values. Tables of forbidden tuples remain only if they
    have more than `MAX_ALLOWED_ROWS` allowed tuples.
    """
    filtered = _Filter(network)
    if not filtered.run():
        return Network(tuple(() for _ in network.domains))
    domains = tuple(tuple(sorted(domain)) for domain in filtered.domains)
    left = [_without_fixed(table, domains) for table in filtered.tables]
    tables = [_allowing(table, domains) for table in left if not _allows_everything(table, domains)]
    chosen = [tuple([place for place in scope if len(domains[place]) > 1]) for scope in network.different]
    scopes = [scope for scope in chosen if len(scope) > 1]
    spelt_out = [_spelt_out(scope, domains) for scope in scopes if is_small_permutation(scope, domains)]
    kept = tuple(scope for scope in scopes if not is_small_permutation(scope, domains))
    formulas, unary = _simplified(network.formulas, domains)
    if FALSE in formulas:
        return Network(tuple(() for _ in domains))
    result = Network(domains, (*tables, *spelt_out, *unary), kept, formulas)
    # New tables may allow further propagation.
    forbidding = sum(not table.allowed for table in filtered.tables)
    fewer = forbidding > sum(not table.allowed for table in tables)
    return propagate(result) if spelt_out or unary or fewer else result


def _simplified(formulas: Sequence[Formula], domains: Sequence[Codes]) -> tuple[tuple[Formula, ...], list[CodeTable]]:
    """Return `formulas` without variables that have one value; formulas on one variable become tables."""
    fixed: dict[Operand, int] = {place: domain[0] for place, domain in enumerate(domains) if len(domain) == 1}
    parts = [part for formula in formulas for part in conjuncts(renamed(formula, {}, fixed))]
    wider = tuple([part for part in parts if len(operands(part)) != 1])
    tables = []
    for part in parts:
        if len(operands(part)) == 1:
            (place,) = map(int, operands(part))
            rows = tuple([(code,) for code in domains[place] if holds(part, {place: code})])
            tables.append(CodeTable((place,), allowed=True, rows=rows))
    return wider, tables


class _Filter:
    """Removes values without support until all remaining values have support."""

    def __init__(self, network: Network) -> None:
        self.domains = [set(domain) for domain in network.domains]
        self.tables = [_allowing(table, network.domains) for table in network.tables]
        self._different = network.different
        self._waiting = dict.fromkeys(range(len(self.tables)))
        self._tables_at: list[list[int]] = [[] for _ in network.domains]
        for number, table in enumerate(self.tables):
            for place in table.scope:
                self._tables_at[place].append(number)

    def run(self) -> bool:
        """Remove values without support. Return False when a domain is empty."""
        if not all(self.domains):
            return False
        while True:
            while self._waiting:
                number, _ = self._waiting.popitem()
                if not self._revise(number):
                    return False
            if not self._remove_fixed_values():
                return False
            if not self._waiting:
                return True

    def _revise(self, number: int) -> bool:
        table = self.tables[number]
        if not table.rows:
            return not table.allowed
        domains = [self.domains[place] for place in table.scope]
        columns = [set(column) for column in zip(*table.rows, strict=True)]
        if not all(column <= domain for column, domain in zip(columns, domains, strict=True)):
            fits = list(zip(range(len(domains)), domains, strict=True))
            rows = tuple([row for row in table.rows if all(row[index] in domain for index, domain in fits)])
            table = self.tables[number] = replace(table, rows=rows)
            columns = [set(column) for column in zip(*rows, strict=True)]
        if not table.allowed:
            return True
        if not table.rows:
            return False
        for place, supported in zip(table.scope, columns, strict=True):
            self._keep(place, supported)
        return all(domains)

    def _keep(self, place: int, values: set[int]) -> None:
        """Restrict the domain at `place` to `values`, and mark its tables for another check."""
        if not self.domains[place] <= values:
            self.domains[place] &= values
            self._waiting.update(dict.fromkeys(self._tables_at[place]))

    def _remove_fixed_values(self) -> bool:
        """Remove fixed values from the variables that must differ from them. Return False if a domain is empty."""
        before = -1
        while before != (before := sum(map(len, self.domains))):
            for scope in self._different:
                taken = [next(iter(self.domains[place])) for place in scope if len(self.domains[place]) == 1]
                if len(taken) != len(set(taken)):
                    return False
                for place in scope:
                    if len(self.domains[place]) > 1:
                        self._keep(place, self.domains[place].difference(taken))
            if not all(self.domains):
                return False
        return True


def is_small_permutation(scope: Codes, domains: Sequence[Codes]) -> bool:
    """Return whether variables that must all differ are few, and need all their values.

    ACE converts such variables to tables itself, and fails if a variable lacks one of the values.
    """
    values = {code for place in scope for code in domains[place]}
    return len(scope) == len(values) <= LARGEST_PERMUTATION


def _spelt_out(scope: Codes, domains: Sequence[Codes]) -> CodeTable:
    rows = itertools.product(*(domains[place] for place in scope))
    return CodeTable(scope, allowed=True, rows=tuple(row for row in rows if len(set(row)) == len(row)))


def _allowing(table: CodeTable, domains: Sequence[Codes]) -> CodeTable:
    """Return `table` as a table of allowed tuples, unless there are too many."""
    if table.allowed or math.prod(len(domains[place]) for place in table.scope) > MAX_ALLOWED_ROWS:
        return table
    forbidden = set(table.rows)
    rows = itertools.product(*(domains[place] for place in table.scope))
    return CodeTable(table.scope, allowed=True, rows=tuple(row for row in rows if row not in forbidden))


def _without_fixed(table: CodeTable, domains: Sequence[Codes]) -> CodeTable:
    """Return `table` without variables that have one value; all its rows agree with these values."""
    kept = [index for index, place in enumerate(table.scope) if len(domains[place]) > 1]
    if len(kept) == len(table.scope):
        return table
    rows = sorted({tuple([row[index] for index in kept]) for row in table.rows})
    return CodeTable(tuple([table.scope[index] for index in kept]), table.allowed, tuple(rows))


def _allows_everything(table: CodeTable, domains: Sequence[Codes]) -> bool:
    if not table.allowed:
        return not table.rows
    return len(table.rows) == math.prod(len(domains[place]) for place in table.scope)
