"""Uniform binary random problems: Model B, a robot a variable; with or without costs.

Gent, MacIntyre, Prosser, Smith and Walsh, "Random constraint satisfaction: flaws and structure", Constraints 6
(2001), Section 2; Prosser, "An empirical study of phase transitions in binary constraint satisfaction problems", AIJ
81 (1996). A problem <n, d, p1, p2> has n variables with d values each. Of the n(n-1)/2 pairs of variables exactly
p1 n(n-1)/2 are constrained, and each constraint forbids exactly p2 d^2 pairs of values; every such problem is as
likely as any other. Both numbers are rounded as Python's `round` does, halves to the even one.

As the 2001 paper shows, problems with p2 >= 1/d are flawed when they are large enough: nearly all of them have a
variable of which each value alone is ruled out by a neighbour. At the sizes that protocols are compared on (up to
some tens of variables) that is rare.

With `max_cost`, pairs of values that are not forbidden cost something: each a number from 0 to `max_cost`, all as
likely, whatever the others cost. With a tightness of 0 nothing is forbidden. That is the usual random DCOP.

A seed makes the same problem on every machine and with every version of Python: of `random.Random` only the seeding
by an integer and `random()` are used, which Python's documentation promises to keep.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from random import Random

from robochoc.model.problem import (
    INFINITE,
    Child,
    Constraint,
    Domain,
    Parent,
    ProblemKind,
    Relation,
    Robot,
    Semantics,
    Team,
    Variable,
)

MAX_AGENTS = 1000
MAX_VALUES = 1000
MAX_FORBIDDEN_PAIRS = 1_000_000
"""The maximum for all constraints together: robots' files stay readable. With costs: the maximum of pairs of values."""
MAX_COST = 1_000_000
MAX_GRAPH_DRAWS = 1000
"""The maximum number of graphs that are drawn to find a connected one."""

Edge = tuple[int, int]
"""Numbers of two robots, the smaller one first."""


def random_csp(
    agents: int,
    domain: int,
    density: float,
    tightness: float,
    seed: int = 0,
    *,
    connected: bool = False,
    max_cost: int | None = None,
) -> Team:
    """Return the team of the problem <agents, domain, density, tightness> that `seed` stands for.

    `Robot3` owns `V3` and holds its constraints with robots of smaller numbers.

    Args:
        agents: The number of robots, each with one variable.
        domain: The number of values of each variable.
        density: The share of constrained pairs of variables, from 0 to 1.
        tightness: The share of forbidden pairs of values in a constraint, from 0 to 1.
        seed: The same seed makes the same problem on every machine.
        connected: Whether graphs are drawn until one is connected. Each connected graph is then as likely as any other.
        max_cost: The maximum cost of pairs of values that are not forbidden: the team is a DisWCSP. None: no costs.

    Raises:
        ValueError: if there is no such problem, or it is too large. The text says which number to change.

    Example:
        >>> from robochoc.generators.random_csp import random_csp
        >>> len(list(random_csp(10, 3, 0.5, 0.33).constraints()))
        22
    """
    pairs, rows = _sizes(agents, domain, density, tightness)
    count, forbidden = round(density * pairs), round(tightness * domain**2)
    if count * forbidden > MAX_FORBIDDEN_PAIRS:
        raise ValueError(
            f"{count:,} constraints of {forbidden:,} forbidden pairs are more than {MAX_FORBIDDEN_PAIRS:,}"
        )
    if max_cost is not None:
        _check_costs(max_cost, count * rows)
    chance = Random(seed)  # noqa: S311 - a problem, not a secret
    constraints = {}
    for edge in random_graph(chance, agents, count, connected=connected):
        relation = _forbidding(edge, _some(chance, rows, forbidden), domain)
        if max_cost is not None:
            relation = _charging(chance, relation, domain, max_cost)
        scope = tuple(f"V{number}" for number in edge)
        constraints[edge] = Constraint(f"C{edge[0]}.{edge[1]}", relation, scope, scope)
    costs = "" if max_cost is None else f"-cost{max_cost}"
    name = f"random-{agents}-{domain}-{float(density)}-{float(tightness)}{costs}-{seed}{'-connected' * connected}"
    return team_of_edges(
        name, agents, domain, constraints, ProblemKind.DISCSP if max_cost is None else ProblemKind.DISWCSP
    )


def team_of_edges(
    name: str, agents: int, domain: int, constraints: Mapping[Edge, Constraint], kind: ProblemKind
) -> Team:
    """Return a team in which `Robot3` owns `V3`. The lower robot of an edge holds the edge's constraint."""
    values = Domain("D", (range(1, domain + 1),))
    above: dict[int, list[Parent]] = {number: [] for number in range(1, agents + 1)}
    below: dict[int, list[Child]] = {number: [] for number in above}
    for (higher, lower), constraint in constraints.items():
        above[lower].append(Parent(f"Robot{higher}", (constraint,)))
        below[higher].append(Child(f"Robot{lower}", (f"V{higher}",)))
    robots = (
        Robot(
            name=f"Robot{number}",
            variables=(Variable(f"V{number}", values),),
            kind=kind,
            parents=tuple(above[number]),
            children=tuple(below[number]),
        )
        for number in above
    )
    return Team(name, tuple(robots))


def _sizes(agents: int, domain: int, density: float, tightness: float) -> tuple[int, int]:
    """Return how many pairs of robots there are, and how many pairs of values. Raises `ValueError`."""
    for what, number, most in (("agents", agents, MAX_AGENTS), ("domain", domain, MAX_VALUES)):
        if not 1 <= number <= most:
            raise ValueError(f"{what} is {number}; it must be from 1 to {most}")
    for what, share in (("density", density), ("tightness", tightness)):
        if not 0 <= share <= 1:
            raise ValueError(f"{what} is {share}; it must be from 0 to 1")
    return agents * (agents - 1) // 2, domain**2


def _check_costs(max_cost: int, pairs: int) -> None:
    """Raise `ValueError` unless so many pairs of values can have costs of at most `max_cost`."""
    if not 0 <= max_cost <= MAX_COST:
        raise ValueError(f"max-cost is {max_cost}; it must be from 0 to {MAX_COST}")
    if pairs > MAX_FORBIDDEN_PAIRS:
        raise ValueError(f"all constraints together have {pairs:,} pairs of values, more than {MAX_FORBIDDEN_PAIRS:,}")


def random_graph(chance: Random, agents: int, count: int, *, connected: bool = False) -> list[Edge]:
    """Return `count` pairs of robots, in ascending order, each choice as likely as any other; see `random_csp`."""
    return _connected(chance, agents, count) if connected else _edges(chance, agents, count)


def _edges(chance: Random, agents: int, count: int) -> list[Edge]:
    """Return `count` pairs of robots, in ascending order."""
    chosen = set(_some(chance, agents * (agents - 1) // 2, count))
    pairs = ((higher, lower) for higher in range(1, agents) for lower in range(higher + 1, agents + 1))
    return [pair for place, pair in enumerate(pairs) if place in chosen]


def _connected(chance: Random, agents: int, count: int) -> list[Edge]:
    """Return `count` pairs of robots that link them all: drawn until they do.

    Raises `ValueError` when that is in vain.
    """
    if count < agents - 1:
        raise ValueError(
            f"a connected graph of {agents} robots needs {agents - 1} constraints, and the density makes {count}"
        )
    for _ in range(MAX_GRAPH_DRAWS):
        edges = _edges(chance, agents, count)
        if _links_all(edges, agents):
            return edges
    raise ValueError(
        f"none of {MAX_GRAPH_DRAWS:,} graphs of {agents} robots and {count} constraints was connected;"
        " raise the density"
    )


def _links_all(edges: list[Edge], agents: int) -> bool:
    near: dict[int, list[int]] = {number: [] for number in range(1, agents + 1)}
    for one, other in edges:
        near[one].append(other)
        near[other].append(one)
    met = {1}
    waiting = [1]
    while waiting:
        new = [number for number in near[waiting.pop()] if number not in met]
        met.update(new)
        waiting += new
    return len(met) == agents


def _forbidding(edge: Edge, forbidden: list[int], domain: int) -> Relation:
    higher, lower = edge
    tuples = tuple((place // domain + 1, place % domain + 1) for place in forbidden)
    return Relation(f"R{higher}.{lower}", 2, Semantics.CONFLICTS, tuples)


def _charging(chance: Random, relation: Relation, domain: int, max_cost: int) -> Relation:
    """Return `relation`, which forbids pairs of values, with a cost for all others."""
    priced: dict[tuple[int, ...], float] = dict.fromkeys(relation.tuples, INFINITE)
    for pair in itertools.product(range(1, domain + 1), repeat=2):
        if pair not in priced:
            priced[pair] = int(chance.random() * (max_cost + 1))
    listed = sorted(pair for pair, cost in priced.items() if cost)
    return Relation(relation.name, 2, Semantics.SOFT, tuple(listed), tuple(priced[pair] for pair in listed))


def _some(chance: Random, size: int, count: int) -> list[int]:
    """Return `count` different numbers below `size`, in ascending order; each choice is as likely as any other."""
    return sorted(_drawn(chance, size, count))


def _drawn(chance: Random, size: int, count: int) -> Iterator[int]:
    """Yield the first steps of the Fisher-Yates shuffle of all numbers below `size`. Only moved numbers are stored."""
    moved: dict[int, int] = {}
    for left in range(size, size - count, -1):
        place = int(chance.random() * left)
        yield moved.get(place, place)
        moved[place] = moved.get(left - 1, left - 1)
