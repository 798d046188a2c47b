"""Random teams with costs whose pseudo-trees are wide, of few values: for protocols that cut, or count, tables."""

from __future__ import annotations

import itertools
from random import Random

from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of


def wide_team(chance: Random) -> Team:
    """A team of 4 to 9 robots with 1 to 3 values, dense or sparse; some constraints are hard, some over three robots.

    One in five falls into parts.
    """
    size = chance.choice((4, 5, 6, 7, 7, 8, 8, 9))
    domains = {f"X{number}": tuple(range(chance.choice((1, 2, 2, 2, 3)))) for number in range(size)}
    names = list(domains)
    chance.shuffle(names)
    density, hard = chance.uniform(0.3, 1), chance.choice((0, 0.1, 0.25))
    half = size // 2 if chance.random() < 0.2 else 0
    pairs = [(one, other) for one, other in itertools.combinations(names, 2) if chance.random() < density]
    scopes: list[tuple[str, ...]] = [
        pair for pair in pairs if not half or (names.index(pair[0]) < half) == (names.index(pair[1]) < half)
    ]
    scopes += [tuple(chance.sample(names[half:], 3)) for _ in range(chance.choice((0, 0, 0, 1, 2))) if size - half > 2]
    scopes += [(name,) for name in names if chance.random() < 0.3]

    def constraint(scope: tuple[str, ...]) -> Constraint:
        rows = tuple(itertools.product(*(domains[name] for name in scope)))
        costs = tuple(INFINITE if chance.random() < hard else chance.randint(0, 9) for _ in rows)
        return Constraint("C", Relation("R", len(scope), Semantics.SOFT, rows, costs), scope, scope)

    return with_costs(team_of(domains, map(constraint, scopes), "wide"))
