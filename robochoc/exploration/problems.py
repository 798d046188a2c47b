"""Small random teams of the kinds that a protocol accepts: with and without solutions, with costs, n-ary, tasks."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from random import Random

from robochoc.generators.draws import random_integer, seeded
from robochoc.generators.tasks import Travel, tasks
from robochoc.model.assembly import Extras, assemble
from robochoc.model.problem import (
    INFINITE,
    Constraint,
    Domain,
    ProblemKind,
    Relation,
    Semantics,
    Team,
    Variable,
)
from robochoc.protocols.traits import Traits

_MOST_COST = 3
_SHARE_N_ARY = 0.3
_SHARE_PARTIAL = 0.5
_TRIPLE = 3


def small_teams(traits: Traits, robots: int, values: int, seed: int) -> Iterator[Team]:
    """Yield random teams without end, for a protocol with these `traits`.

    Args:
        traits: The traits of the protocol.
        robots: The maximum number of robots; the minimum is 2.
        values: The maximum number of values of a robot; for task allocations, of tasks.
        seed: The same seed gives the same teams on every machine.
    """
    for number in itertools.count():
        chance = seeded(seed * 1_000_003 + number)
        size = random_integer(chance, min(2, robots), robots)
        if traits.allocates:
            count = random_integer(chance, 1, values)
            yield tasks(size, count, random_integer(chance, 0, 1 << 30), worth=9, travel=Travel(side=3))
        else:
            yield _random_team(f"small-{robots}-{values}-{seed}-{number}", traits, chance, size, values)


def _random_team(name: str, traits: Traits, chance: Random, size: int, values: int) -> Team:
    names = [f"V{number}" for number in range(1, size + 1)]
    sizes = {one: random_integer(chance, min(2, values), values) for one in names}
    variables = {
        f"Robot{one[1:]}": [Variable(one, Domain(f"D{count}", (range(count),)))] for one, count in sizes.items()
    }
    density, tightness = 0.4 + 0.6 * chance.random(), 0.2 + 0.6 * chance.random()
    scopes: list[Sequence[str]] = [pair for pair in itertools.combinations(names, 2) if chance.random() < density]
    if traits.n_ary and size >= _TRIPLE and chance.random() < _SHARE_N_ARY:
        scopes.append(names[:_TRIPLE])
    partial = traits.partially_known and chance.random() < _SHARE_PARTIAL
    constraints, parts = [], dict[str, list[Constraint]]()
    for number, scope in enumerate(scopes, 1):
        rows = list(itertools.product(*(range(sizes[one]) for one in scope)))
        if partial and len(scope) == 2:  # noqa: PLR2004 - a partially known constraint has two robots
            for one in scope:
                part = _constraint(chance, f"C{number}", scope, rows, tightness, is_soft=traits.asymmetric)
                parts.setdefault(f"Robot{one[1:]}", []).append(part)
        else:
            constraints.append(_constraint(chance, f"C{number}", scope, rows, tightness, is_soft=traits.costs))
    kind = ProblemKind.DISWCSP if traits.costs else ProblemKind.DISCSP
    return assemble(name, variables, constraints, kind=kind, extras=Extras(parts=parts))


def _constraint(
    chance: Random,
    name: str,
    scope: Sequence[str],
    rows: Sequence[tuple[int, ...]],
    tightness: float,
    *,
    is_soft: bool,
) -> Constraint:
    """Return a random constraint over `scope`. If it `is_soft`, its costs are up to 3, and some rows are forbidden."""
    if not is_soft:
        forbidden = tuple([row for row in rows if chance.random() < tightness])
        relation = Relation("R", len(scope), Semantics.CONFLICTS, forbidden)
    else:
        hard = tightness / 4
        costs = [INFINITE if chance.random() < hard else random_integer(chance, 0, _MOST_COST) for _ in rows]
        relation = Relation("R", len(scope), Semantics.SOFT, tuple(rows), tuple(costs), 0)
    return Constraint(name, relation, tuple(scope), tuple(scope))
