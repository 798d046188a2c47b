"""Makes a network say outright what its binary tables say between the lines.

ACE prunes a table at a time. Where tables forbid equal values between all pairs of some variables, one allDifferent
sees more; where they forbid more than that, as between the queens of a row, the solutions of the clique as one table
see everything. Nothing is added to the problem: every solution stays one, and nothing else becomes one.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, replace

from robochoc.solver.encoding import Codes, Network, Table

Edge = tuple[int, int]


@dataclass(frozen=True)
class Differing:
    """The pairs of variables whose values must differ; `stronger` are those that owe each other more than that."""

    pairs: frozenset[Edge]
    stronger: frozenset[Edge]


def differing(network: Network) -> Differing:
    """The graph of the `ne` that the binary tables of `network` imply."""
    pairs, stronger = set(), set()
    known: dict[Hashable, tuple[bool, bool]] = {}
    for table in network.tables:
        if len(table.scope) != 2:  # noqa: PLR2004 - binary
            continue
        left, right = table.scope
        alike = id(table.rows), table.allowed, network.domains[left], network.domains[right]
        if alike not in known:
            equal = {(code, code) for code in set(network.domains[left]).intersection(network.domains[right])}
            forbidden = _forbidden(network, table)
            known[alike] = equal <= forbidden, equal < forbidden
        differ, more = known[alike]
        if differ:
            pairs.add((left, right))
        if more:
            stronger.add((left, right))
    return Differing(frozenset(pairs), frozenset(stronger))


def cliques(pairs: Iterable[Edge]) -> list[Codes]:
    """Cliques that together cover all `pairs`, each grown as long as it covers something new."""
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


def strengthened(network: Network, solutions: Callable[[Network], tuple[Codes, ...] | None]) -> Network:
    """`network` with allDifferent on cliques of `ne`, and with tables for the cliques that owe each other more.

    `solutions` gives all solutions of a sub-network, or None where there are too many to be a table.
    """
    found = differing(network)
    different: list[Codes] = []
    compiled: list[Table] = []
    for clique in cliques(found.pairs):
        edges = set(itertools.combinations(clique, 2))
        if len(clique) == 2:  # noqa: PLR2004 - an edge, which its table covers
            continue
        rows = solutions(_within(network, clique)) if edges <= found.stronger else None
        if rows is None:
            different.append(clique)
        else:
            compiled.append(Table(clique, allowed=True, rows=tuple(sorted(rows))))
    said = {pair for scope in different for pair in itertools.combinations(scope, 2)} - found.stronger
    covered = [set(table.scope) for table in compiled]
    kept = [
        table
        for table in network.tables
        if table.scope not in said and not any(scope.issuperset(table.scope) for scope in covered)
    ]
    return replace(network, tables=(*compiled, *kept), different=tuple(different))


def _grown(clique: list[int], neighbours: dict[int, set[int]], open_still: dict[int, set[int]]) -> list[int]:
    """`clique`, with more members as long as one covers new edges; the one that covers most comes first."""
    candidates = set.intersection(*(neighbours[name] for name in clique))
    while candidates:
        best = min(candidates, key=lambda name: (-len(open_still[name].intersection(clique)), name))
        if not open_still[best].intersection(clique):
            break
        clique.append(best)
        candidates &= neighbours[best]
    return clique


def _forbidden(network: Network, table: Table) -> set[Codes]:
    if not table.allowed:
        return set(table.rows)
    everything: Iterable[Codes] = itertools.product(*(network.domains[place] for place in table.scope))
    return set(everything).difference(table.rows)


def _within(network: Network, clique: Codes) -> Network:
    """The part of `network` on the variables of `clique` alone."""
    place = {name: index for index, name in enumerate(clique)}
    tables = (
        replace(table, scope=tuple([place[name] for name in table.scope]))
        for table in network.tables
        if all(name in place for name in table.scope)
    )
    return Network(tuple(network.domains[name] for name in clique), tuple(tables))
