"""The constraint graph of a team's variables, and the pseudo-tree of a depth-first search over its robots."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

from robochoc.model.orders import Order, compute_order, constraint_graph
from robochoc.model.problem import Team


def shared_constraints(team: Team) -> Counter[tuple[str, str]]:
    """Return the number of constraints that each pair of variables shares, including parts of PKC constraints."""
    place = {name: number for number, name in enumerate(team.variables)}
    pairs: Counter[tuple[str, str]] = Counter()
    for constraint in {id(one): one for one in team.constraints()}.values():
        for one, other in combinations(sorted(constraint.variables, key=place.__getitem__), 2):
            pairs[one, other] += 1
    return pairs


def pseudo_tree(team: Team) -> dict[str, str | None]:
    """Return each robot's parent in the pseudo-tree of a depth-first search, or None for a root.

    The search starts at the robot with the most neighbours and visits neighbours with more neighbours first.
    """
    graph = constraint_graph(team)
    order = compute_order(team, Order.DFS)
    place = {name: number for number, name in enumerate(order)}
    above: dict[str, str | None] = {}
    for name in order:
        higher = [other for other in graph[name] if place[other] < place[name]]
        above[name] = max(higher, key=place.__getitem__, default=None)
    return above
