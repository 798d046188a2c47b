"""Random problems with constraints of any arity, also with costs.

This is Model RB: Xu and Li, "Exact phase transitions in random constraint satisfaction problems", JAIR 12 (2000). The
scopes are drawn with repetition, each with different variables. Each constraint forbids the same number of tuples,
drawn without repetition. With a maximum cost, all other tuples have uniformly random costs, as in `random_csp.py`.
"""

from __future__ import annotations

from random import Random

from robochoc.generators.draws import (
    MAX_AGENTS,
    MAX_CONSTRAINTS,
    MAX_COST,
    MAX_VALUES,
    check_bounds,
    random_integer,
    sample,
    seeded,
)
from robochoc.model.assembly import assemble
from robochoc.model.problem import INFINITE, Constraint, Domain, ProblemKind, Relation, Semantics, Team, Variable

MAX_ARITY = 10
MAX_TUPLES = 1_000_000
"""The maximum number of tuples of all constraints together."""


def nary(
    *,
    agents: int,
    domain: int,
    constraints: int,
    arity: int = 3,
    tightness: float = 0.0,
    max_cost: int | None = None,
    seed: int = 0,
) -> Team:
    """Return a random problem whose constraints have `arity` variables each.

    `Robot3` owns `V3`.

    Args:
        agents: The number of robots, each with one variable.
        domain: The number of values of each variable.
        constraints: The number of constraints.
        arity: The number of variables of each constraint.
        tightness: The fraction of tuples that a constraint forbids, from 0 to 1.
        max_cost: The maximum cost of tuples that are not forbidden, in a DCOP. None: no costs.
        seed: The same seed gives the same problem on every machine.

    Raises:
        ValueError: A number is out of bounds, or the problem is too large.
    """
    check_bounds({"agents": (agents, 1, MAX_AGENTS), "domain": (domain, 1, MAX_VALUES)})
    check_bounds({"constraints": (constraints, 0, MAX_CONSTRAINTS), "arity": (arity, 1, min(agents, MAX_ARITY))})
    check_bounds({"tightness": (tightness, 0, 1), "max-cost": (max_cost or 0, 0, MAX_COST)})
    if constraints * domain**arity > MAX_TUPLES:
        raise ValueError(
            f"{constraints:,} constraints with {domain**arity:,} tuples each have more than {MAX_TUPLES:,} together;"
            " use smaller domains, a smaller arity, or fewer constraints"
        )
    chance = seeded(seed)
    forbidden = round(tightness * domain**arity)
    found = []
    for number in range(1, constraints + 1):
        scope = tuple(f"V{place + 1}" for place in sample(chance, agents, arity))
        found.append(
            Constraint(f"C{number}", _relation(chance, number, (domain, arity, forbidden), max_cost), scope, scope)
        )
    values = Domain("D", (range(1, domain + 1),))
    label = "" if max_cost is None else f"-cost{max_cost}"
    return assemble(
        f"nary-{agents}-{domain}-{constraints}x{arity}-{float(tightness)}{label}-{seed}",
        {f"Robot{number}": [Variable(f"V{number}", values)] for number in range(1, agents + 1)},
        found,
        kind=ProblemKind.DISCSP if max_cost is None else ProblemKind.DISWCSP,
    )


def _relation(chance: Random, number: int, numbers: tuple[int, int, int], max_cost: int | None) -> Relation:
    """Return a random relation; `numbers` are the number of values, the arity, and the number of forbidden tuples."""
    domain, arity, forbidden = numbers
    places = sample(chance, domain**arity, forbidden)
    if max_cost is None:
        return Relation(f"R{number}", arity, Semantics.CONFLICTS, tuple(_row(place, domain, arity) for place in places))
    excluded = set(places)
    costs = [INFINITE if place in excluded else random_integer(chance, 0, max_cost) for place in range(domain**arity)]
    listed = [place for place, cost in enumerate(costs) if cost]
    rows = tuple(_row(place, domain, arity) for place in listed)
    return Relation(f"R{number}", arity, Semantics.SOFT, rows, tuple(costs[place] for place in listed))


def _row(place: int, domain: int, arity: int) -> tuple[int, ...]:
    """Return tuple number `place` of all tuples in lexicographic order."""
    return tuple(place // domain**power % domain + 1 for power in reversed(range(arity)))
