"""Makes cliques in the binary tables of a network explicit.

ACE prunes one table at a time. If tables forbid equal values between all pairs of some variables, an allDifferent
prunes more; if they forbid more than that, as between the queens in a row, a single table with the clique's solutions
prunes most. The solutions of the network stay the same.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Iterable
from dataclasses import replace
from enum import StrEnum

from robochoc.solver.encoding import Codes, CodeTable, Network
from robochoc.solver.propagation import is_small_permutation


class Demand(StrEnum):
    """The kind of a binary table: the two variables must differ, must differ and more, or something else."""

    DIFFER = "differ"
    DIFFER_AND_MORE = "differ and more"
    OTHER = "other"


def demands(network: Network) -> list[Demand]:
    """Return the demand of each table of `network`."""
    known: dict[Hashable, Demand] = {}
    found = []
    for table in network.tables:
        alike = id(table.rows), table.allowed, tuple([network.domains[place] for place in table.scope])
        if alike not in known:
            known[alike] = _demand(network, table)
        found.append(known[alike])
    return found


def _demand(network: Network, table: CodeTable) -> Demand:
    if len(table.scope) != 2:  # noqa: PLR2004 - binary
        return Demand.OTHER
    left, right = (set(network.domains[place]) for place in table.scope)
    equal = {(code, code) for code in left & right}
    forbidden = _forbidden(network, table)
    if not equal <= forbidden:
        return Demand.OTHER
    return Demand.DIFFER if equal == forbidden else Demand.DIFFER_AND_MORE


def cliques(pairs: Iterable[Codes]) -> list[Codes]:
    """Return cliques that cover all `pairs`; each clique is extended as long as it covers new pairs."""
    neighbours: dict[int, set[int]] = {}
    for left, right in pairs:
        neighbours.setdefault(left, set()).add(right)
        neighbours.setdefault(right, set()).add(left)
    open_still = {name: set(others) for name, others in neighbours.items()}
    found = []
    for left, right in sorted(pairs):
        if right in open_still[left]:
            clique = _grown([left, right], neighbours, open_still)
            for one, other in itertools.permutations(clique, 2):
                open_still[one].discard(other)
            found.append(tuple(sorted(clique)))
    return found


def with_cliques(network: Network, solutions: Callable[[Network], tuple[Codes, ...] | None]) -> Network:
    """Return `network` with an allDifferent for each clique of `ne`, and tables for cliques with more constraints.

    Only cliques that need all their values become tables, because few combinations are left in these.

    `solutions` returns all solutions of a sub-network, or None if there are too many for a table.
    """
    demanded = demands(network)
    differ = {t.scope: d for t, d in zip(network.tables, demanded, strict=True) if d != Demand.OTHER}
    more = {t.scope for t, d in zip(network.tables, demanded, strict=True) if d == Demand.DIFFER_AND_MORE}
    different: list[Codes] = []
    compiled: list[CodeTable] = []
    for clique in cliques(differ):
        edges = set(itertools.combinations(clique, 2))
        if len(clique) == 2:  # noqa: PLR2004 - an edge has a table already
            continue
        tight = len(clique) == len({code for place in clique for code in network.domains[place]})
        rows = solutions(_within(network, clique)) if tight and edges <= more else None
        if rows is not None:
            compiled.append(CodeTable(clique, allowed=True, rows=tuple(sorted(rows))))
        elif not is_small_permutation(clique, network.domains):
            different.append(clique)
    different_pairs = {pair for scope in different for pair in itertools.combinations(scope, 2)}
    covered = [set(table.scope) for table in compiled]
    kept = [
        table
        for table, demand in zip(network.tables, demanded, strict=True)
        if not (demand == Demand.DIFFER and table.scope in different_pairs)
        and not any(scope.issuperset(table.scope) for scope in covered)
    ]
    return replace(network, tables=(*compiled, *kept), different=(*network.different, *different))


def _grown(clique: list[int], neighbours: dict[int, set[int]], open_still: dict[int, set[int]]) -> list[int]:
    """Return `clique`, extended while a new member covers new edges; members that cover most edges are added first."""
    candidates = set.intersection(*(neighbours[name] for name in clique))
    while candidates:
        best = min(candidates, key=lambda name: (-len(open_still[name].intersection(clique)), name))
        if not open_still[best].intersection(clique):
            break
        clique.append(best)
        candidates &= neighbours[best]
    return clique


def _forbidden(network: Network, table: CodeTable) -> set[Codes]:
    if not table.allowed:
        return set(table.rows)
    everything: Iterable[Codes] = itertools.product(*(network.domains[place] for place in table.scope))
    return set(everything).difference(table.rows)


def _within(network: Network, clique: Codes) -> Network:
    """Return the sub-network on the variables of `clique`."""
    place = {name: index for index, name in enumerate(clique)}
    tables = (
        replace(table, scope=tuple([place[name] for name in table.scope]))
        for table in network.tables
        if all(name in place for name in table.scope)
    )
    return Network(tuple(network.domains[name] for name in clique), tuple(tables))
