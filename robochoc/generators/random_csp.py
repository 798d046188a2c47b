"""Uniform binary random DisCSPs: Model B, a robot a variable.

Gent, MacIntyre, Prosser, Smith and Walsh, "Random constraint satisfaction: flaws and structure", Constraints 6
(2001), Section 2; Prosser, "An empirical study of phase transitions in binary constraint satisfaction problems", AIJ
81 (1996). A problem <n, d, p1, p2> has n variables with d values each. Of the n(n-1)/2 pairs of variables exactly
p1 n(n-1)/2 are constrained, and each constraint forbids exactly p2 d^2 pairs of values; every such problem is as
likely as any other. Both numbers are rounded as Python's `round` does, halves to the even one.

As the 2001 paper shows, problems with p2 >= 1/d are flawed when they are large enough: nearly all of them have a
variable of which each value alone is ruled out by a neighbour. At the sizes that protocols are compared on (up to
some tens of variables) that is rare.

A seed makes the same problem on every machine and with every version of Python: of `random.Random` only the seeding
by an integer and `random()` are used, which Python's documentation promises to keep.
"""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

from robochoc.problem import Child, Constraint, Domain, Parent, Relation, Robot, Semantics, Team, Variable

MOST_AGENTS = 1000
MOST_VALUES = 1000
MOST_FORBIDDEN = 1_000_000
"""Of all constraints together: so no robot's file grows beyond what can be read."""
DRAWS = 1000
"""So many graphs are drawn in search of a connected one."""

Edge = tuple[int, int]
"""Numbers of two robots, the smaller one first."""


def random_csp(
    agents: int, domain: int, density: float, tightness: float, seed: int = 0, *, connected: bool = False
) -> Team:
    """The team of the problem <agents, domain, density, tightness> that `seed` stands for.

    `Robot3` owns `V3` and holds its constraints with robots of smaller numbers. With `connected`, graphs are drawn
    until one is connected, so that each connected graph is as likely as any other.

    Raises `ValueError` for a problem that cannot be, or is too large; its text says which number to change.
    """
    pairs, rows = _sizes(agents, domain, density, tightness)
    count, forbidden = round(density * pairs), round(tightness * domain**2)
    if count * forbidden > MOST_FORBIDDEN:
        raise ValueError(f"{count:,} constraints of {forbidden:,} forbidden pairs are more than {MOST_FORBIDDEN:,}")
    chance = Random(seed)  # noqa: S311 - a problem, not a secret
    edges = _connected(chance, agents, count) if connected else _edges(chance, agents, count)
    constraints = {edge: _constraint(edge, _some(chance, rows, forbidden), domain) for edge in edges}
    name = f"random-{agents}-{domain}-{float(density)}-{float(tightness)}-{seed}{'-connected' * connected}"
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
            parents=tuple(above[number]),
            children=tuple(below[number]),
        )
        for number in above
    )
    return Team(name, tuple(robots))


def _sizes(agents: int, domain: int, density: float, tightness: float) -> tuple[int, int]:
    """How many pairs of robots there are, and how many pairs of values. Raises `ValueError`."""
    for what, number, most in (("agents", agents, MOST_AGENTS), ("domain", domain, MOST_VALUES)):
        if not 1 <= number <= most:
            raise ValueError(f"{what} is {number}; it must be from 1 to {most}")
    for what, share in (("density", density), ("tightness", tightness)):
        if not 0 <= share <= 1:
            raise ValueError(f"{what} is {share}; it must be from 0 to 1")
    return agents * (agents - 1) // 2, domain**2


def _edges(chance: Random, agents: int, count: int) -> list[Edge]:
    """`count` pairs of robots, in ascending order."""
    chosen = set(_some(chance, agents * (agents - 1) // 2, count))
    pairs = ((higher, lower) for higher in range(1, agents) for lower in range(higher + 1, agents + 1))
    return [pair for place, pair in enumerate(pairs) if place in chosen]


def _connected(chance: Random, agents: int, count: int) -> list[Edge]:
    """`count` pairs of robots that link them all: drawn until they do. Raises `ValueError` when that is in vain."""
    if count < agents - 1:
        raise ValueError(
            f"a connected graph of {agents} robots needs {agents - 1} constraints, and the density makes {count}"
        )
    for _ in range(DRAWS):
        edges = _edges(chance, agents, count)
        if _links_all(edges, agents):
            return edges
    raise ValueError(
        f"none of {DRAWS:,} graphs of {agents} robots and {count} constraints was connected; raise the density"
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


def _constraint(edge: Edge, forbidden: list[int], domain: int) -> Constraint:
    higher, lower = edge
    tuples = tuple((place // domain + 1, place % domain + 1) for place in forbidden)
    relation = Relation(f"R{higher}.{lower}", 2, Semantics.CONFLICTS, tuples)
    scope = (f"V{higher}", f"V{lower}")
    return Constraint(f"C{higher}.{lower}", relation, scope, scope)


def _some(chance: Random, size: int, count: int) -> list[int]:
    """`count` different numbers below `size`, in ascending order; each choice is as likely as any other."""
    return sorted(_drawn(chance, size, count))


def _drawn(chance: Random, size: int, count: int) -> Iterator[int]:
    """The first steps of Fisher and Yates's shuffle of all numbers below `size`, of which only what moved is kept."""
    moved: dict[int, int] = {}
    for left in range(size, size - count, -1):
        place = int(chance.random() * left)
        yield moved.get(place, place)
        moved[place] = moved.get(left - 1, left - 1)
