"""Uniform binary random problems of Model B, one variable per robot, with or without costs, on various graphs.

Gent, MacIntyre, Prosser, Smith and Walsh, "Random constraint satisfaction: flaws and structure", Constraints 6
(2001), Section 2; Prosser, "An empirical study of phase transitions in binary constraint satisfaction problems", AIJ
81 (1996). A problem <n, d, p1, p2> has n variables with d values each. Of the n(n-1)/2 pairs of variables exactly
p1 n(n-1)/2 are constrained, and each constraint forbids exactly p2 d^2 pairs of values; all such problems are equally
likely. Both numbers are rounded like Python's `round`, with halves to even.

As the 2001 paper shows, problems with p2 >= 1/d are flawed if they are large enough: nearly all of them have a
variable each of whose values is excluded by a single neighbour. This is rare at the sizes on which protocols are
compared (up to some tens of variables).

With `max_cost`, each pair of values that is not forbidden has a cost, drawn independently and uniformly from 0 to
`max_cost`. With a tightness of 0 no pair is forbidden, which gives the usual random DCOP. Costs may have decimal
places, and may be utilities whose sum is maximised.

With `asymmetric`, the two robots of a pair have separate costs, drawn independently, and their sum is minimised: the
usual random ADCOP (Grinshpoun, Grubshtein, Zivan, Netzer, Meisels, JAIR 47, 2013). Both robots forbid the same pairs.

`random_on` has a graph instead of p1: scale-free, small world, grid, tree, or from a file (`generators/graphs.py`).

A seed gives the same problem on every machine and with every version of Python (`generators/draws.py`).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from random import Random
from types import MappingProxyType

from robochoc.generators.draws import (
    MAX_COST,
    MAX_NODES,
    MAX_VALUES,
    check_bounds,
    check_places,
    random_integer,
    sample,
    seeded,
)
from robochoc.generators.graphs import Edge, Graph, uniform
from robochoc.model.assembly import Extras, assemble
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits
from robochoc.model.problem import INFINITE, Constraint, Domain, ProblemKind, Relation, Semantics, Team, Variable

MAX_FORBIDDEN_PAIRS = 1_000_000
"""The maximum in all constraints together, for files of a readable size. With costs, the maximum of all pairs."""


def random_csp(  # noqa: PLR0913 - parameters of a family, by their names
    agents: int,
    domain: int,
    density: float,
    tightness: float,
    seed: int = 0,
    *,
    connected: bool = False,
    max_cost: int | None = None,
    costs: CostUnits = PLAIN_COSTS,
    asymmetric: bool = False,
) -> Team:
    """Return a random problem <agents, domain, density, tightness>.

    `Robot3` owns `V3`, and its file has its constraints with robots of smaller numbers.

    Args:
        agents: The number of robots, each with one variable.
        domain: The number of values of each variable.
        density: The fraction of pairs of variables that are constrained, from 0 to 1.
        tightness: The fraction of pairs of values that a constraint forbids, from 0 to 1.
        seed: The same seed gives the same problem on every machine.
        connected: True if graphs are drawn until one is connected. All connected graphs are then equally likely.
        max_cost: The maximum cost of pairs of values that are not forbidden, in a DCOP. None: no costs.
        costs: The decimal places of costs, and whether costs are utilities to be maximised.
        asymmetric: True if the robots of a pair have separate costs (partially known constraints).

    Raises:
        ValueError: There is no such problem, or it is too large. The message names the number to change.

    Example:
        >>> from robochoc.generators.random_csp import random_csp
        >>> len(list(random_csp(10, 3, 0.5, 0.33).constraints()))
        22
    """
    check_bounds({"agents": (agents, 1, MAX_NODES), "domain": (domain, 1, MAX_VALUES), "density": (density, 0, 1)})
    edges = round(density * (agents * (agents - 1) // 2))
    check_bounds({"tightness": (tightness, 0, 1)})
    _check_sizes(edges, domain, tightness, max_cost)
    graph = uniform(agents, edges, str(float(density)), connected=connected)
    return random_on(graph, domain, tightness, seed, max_cost=max_cost, costs=costs, asymmetric=asymmetric)


def random_on(
    graph: Graph,
    domain: int,
    tightness: float,
    seed: int = 0,
    *,
    max_cost: int | None = None,
    costs: CostUnits = PLAIN_COSTS,
    asymmetric: bool = False,
) -> Team:
    """Return a random problem on `graph`; for the parameters see `random_csp`.

    Raises:
        ValueError: There is no such problem, or it is too large. The message names the number to change.
    """
    check_bounds({"domain": (domain, 1, MAX_VALUES), "tightness": (tightness, 0, 1)})
    check_places(costs.places)
    if max_cost is None and costs != PLAIN_COSTS:
        raise ValueError("decimal places and maximising require costs; give a maximum cost")
    if max_cost is None and asymmetric:
        raise ValueError("an asymmetric problem requires costs; give a maximum cost")
    chance = seeded(seed)
    edges = graph.draw(chance)
    _check_sizes(len(edges) * (1 + asymmetric), domain, tightness, max_cost)
    forbidden = round(tightness * domain**2)
    constraints = {}
    parts: dict[str, list[Constraint]] = {f"Robot{number}": [] for number in range(1, graph.agents + 1)}
    most = None if max_cost is None else max_cost * 10**costs.places
    for edge in edges:
        drawn = _drawn(chance, edge, domain, forbidden, [most] * (1 + asymmetric))
        if asymmetric:
            for number, part in zip(edge, drawn, strict=True):
                parts[f"Robot{number}"].append(part)
        else:
            (constraints[edge],) = drawn
    label = "" if max_cost is None else f"-{'utility' if costs.maximize else 'cost'}{max_cost}{places_label(costs)}"
    label += "-asymmetric" * asymmetric
    return team_of_edges(
        f"random-{graph.agents}-{domain}-{graph.label}-{float(tightness)}{label}-{seed}{graph.suffix}",
        graph.agents,
        domain,
        constraints,
        ProblemKind.DISCSP if max_cost is None else ProblemKind.DISWCSP,
        costs,
        parts,
    )


def places_label(costs: CostUnits) -> str:
    """Return the part of a team's name for decimal places: empty, or `.000`."""
    return f".{'0' * costs.places}" if costs.places else ""


def team_of_edges(
    name: str,
    agents: int,
    domain: int,
    constraints: Mapping[Edge, Constraint],
    kind: ProblemKind,
    costs: CostUnits = PLAIN_COSTS,
    parts: Mapping[str, Sequence[Constraint]] = MappingProxyType({}),
) -> Team:
    """Return a team in which `Robot3` owns `V3`. The constraint on an edge belongs to the lower robot.

    `parts` are the parts of partially known constraints, by the name of the robot that knows each part.
    """
    values = Domain("D", (range(1, domain + 1),))
    variables = {f"Robot{number}": [Variable(f"V{number}", values)] for number in range(1, agents + 1)}
    return assemble(name, variables, constraints.values(), kind=kind, costs=costs, extras=Extras(parts=parts))


def _check_sizes(edges: int, domain: int, tightness: float, max_cost: int | None) -> None:
    """Raise `ValueError` if the constraints would have too many pairs of values for files."""
    forbidden = round(tightness * domain**2)
    if edges * forbidden > MAX_FORBIDDEN_PAIRS:
        raise ValueError(
            f"{edges:,} constraints with {forbidden:,} forbidden pairs each have more than"
            f" {MAX_FORBIDDEN_PAIRS:,} together; use smaller domains, or fewer constraints"
        )
    if max_cost is None:
        return
    check_bounds({"max-cost": (max_cost, 0, MAX_COST)})
    pairs = edges * domain**2
    if pairs > MAX_FORBIDDEN_PAIRS:
        raise ValueError(
            f"all constraints together have {pairs:,} pairs of values, more than {MAX_FORBIDDEN_PAIRS:,};"
            " use smaller domains, or fewer constraints"
        )


def _drawn(chance: Random, edge: Edge, domain: int, forbidden: int, sides: Sequence[int | None]) -> list[Constraint]:
    """Return a constraint on `edge` for each of `sides`: a maximum cost, or None for no costs."""
    relation = _forbidding(edge, sample(chance, domain**2, forbidden), domain)
    scope = tuple(f"V{number}" for number in edge)
    relations = [relation if most is None else _charging(chance, relation, domain, most) for most in sides]
    return [Constraint(f"C{edge[0]}.{edge[1]}", one, scope, scope) for one in relations]


def _forbidding(edge: Edge, forbidden: list[int], domain: int) -> Relation:
    higher, lower = edge
    tuples = tuple((place // domain + 1, place % domain + 1) for place in forbidden)
    return Relation(f"R{higher}.{lower}", 2, Semantics.CONFLICTS, tuples)


def _charging(chance: Random, relation: Relation, domain: int, most: int) -> Relation:
    """Return `relation`, which forbids pairs of values, with random costs of at most `most` for all other pairs."""
    priced: dict[tuple[int, ...], float] = dict.fromkeys(relation.tuples, INFINITE)
    for pair in itertools.product(range(1, domain + 1), repeat=2):
        if pair not in priced:
            priced[pair] = random_integer(chance, 0, most)
    listed = sorted(pair for pair, cost in priced.items() if cost)
    return Relation(relation.name, 2, Semantics.SOFT, tuple(listed), tuple(priced[pair] for pair in listed))
