"""Random problems with random variables: a random DCOP in which costs also depend on chance.

Such problems are the benchmark of Leaute and Faltings, "Distributed constraint optimization under stochastic
uncertainty", AAAI 2011: a few random variables, each in the costs of a few robots. Here each of these robots has a
private cost for each pair of its value and an outcome, and may observe the outcome before it chooses. Pairs of robots
have shared costs. All costs are uniform integers from 0 to a maximum, and probabilities have two decimal places.
"""

from __future__ import annotations

import itertools
from random import Random

from robochoc.generators.draws import MAX_AGENTS, MAX_COST, MAX_VALUES, check_bounds, random_integer, sample, seeded
from robochoc.model.assembly import Extras, assemble
from robochoc.model.problem import Constraint, Domain, ProblemKind, Relation, Semantics, Team, Variable
from robochoc.model.random_variable import RandomVariable

MAX_RANDOM = 100
MAX_OUTCOMES = 10
MAX_SEEN = 4096
"""The maximum number of joint outcomes that a robot observes."""


def stochastic(  # noqa: PLR0913 - parameters of a family, by their names
    *,
    agents: int,
    domain: int,
    density: float = 0.4,
    random: int = 2,
    outcomes: int = 2,
    reach: int = 2,
    observed: float = 0.0,
    max_cost: int = 10,
    seed: int = 0,
) -> Team:
    """Return a random problem with random variables.

    `Robot3` owns `V3`; the random variables are `r1`, `r2`, ...

    Args:
        agents: The number of robots, each with one variable.
        domain: The number of values of each variable.
        density: The fraction of pairs of robots that share costs, from 0 to 1.
        random: The number of random variables.
        outcomes: The number of outcomes of each random variable: 1, 2, ...
        reach: The number of robots whose costs depend on a random variable.
        observed: The probability that such a robot observes the outcome before it chooses.
        max_cost: The maximum cost.
        seed: The same seed gives the same problem on every machine.

    Raises:
        ValueError: A number is out of bounds.
    """
    check_bounds({"agents": (agents, 1, MAX_AGENTS), "domain": (domain, 1, MAX_VALUES), "density": (density, 0, 1)})
    check_bounds({"random": (random, 0, MAX_RANDOM), "outcomes": (outcomes, 1, MAX_OUTCOMES)})
    check_bounds({"reach": (reach, 1, agents), "observed": (observed, 0, 1), "max-cost": (max_cost, 0, MAX_COST)})
    chance = seeded(seed)
    pairs = list(itertools.combinations(range(1, agents + 1), 2))
    found = [
        _constraint(chance, f"C{one}.{other}", (f"V{one}", f"V{other}"), (domain, domain), max_cost)
        for one, other in (pairs[place] for place in sample(chance, len(pairs), round(density * len(pairs))))
    ]
    randoms = []
    for number in range(1, random + 1):
        name = f"r{number}"
        cuts = [0, *(cut + 1 for cut in sample(chance, 99, outcomes - 1)), 100]
        weights = tuple(after - before for before, after in itertools.pairwise(cuts))
        reached = [place + 1 for place in sample(chance, agents, reach)]
        seen_by = tuple(f"V{robot}" for robot in reached if chance.random() < observed)
        randoms.append(RandomVariable(name, tuple(range(1, outcomes + 1)), weights, 2, seen_by))
        found += [
            _constraint(chance, f"D{robot}.{number}", (f"V{robot}", name), (domain, outcomes), max_cost)
            for robot in reached
        ]
    for robot in range(1, agents + 1):
        if outcomes ** sum(f"V{robot}" in one.seen_by for one in randoms) > MAX_SEEN:
            raise ValueError(f"Robot{robot} observes more than {MAX_SEEN:,} joint outcomes; use a smaller 'observed'")
    values = Domain("D", (range(1, domain + 1),))
    return assemble(
        f"stochastic-{agents}-{domain}-{float(density)}-{random}x{outcomes}-{reach}-{float(observed)}-{max_cost}-{seed}",
        {f"Robot{robot}": [Variable(f"V{robot}", values)] for robot in range(1, agents + 1)},
        found,
        kind=ProblemKind.DISWCSP,
        extras=Extras(random=randoms),
    )


def _constraint(chance: Random, name: str, scope: tuple[str, str], sizes: tuple[int, int], max_cost: int) -> Constraint:
    rows = list(itertools.product(*(range(1, size + 1) for size in sizes)))
    costs = [random_integer(chance, 0, max_cost) for _ in rows]
    priced = [(row, cost) for row, cost in zip(rows, costs, strict=True) if cost]
    relation = Relation(
        f"R{name}", 2, Semantics.SOFT, tuple(row for row, _ in priced), tuple(cost for _, cost in priced)
    )
    return Constraint(name, relation, scope, scope)
