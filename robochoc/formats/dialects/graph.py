"""The constraint graph of a team's variables, and the pseudo-tree of a depth-first search over its robots."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

from robochoc.model.orders import Order, compute_order, constraint_graph
from robochoc.model.problem import Team


def shared_constraints(team: Team) -> Counter[tuple[str, str]]:
    """Return how many constraints each pair of variables shares, parts of partially known ones included."""
    place = {name: number for number, name in enumerate(team.variables)}
    pairs: Counter[tuple[str, str]] = Counter()
    for constraint in {id(one): one for one in team.constraints()}.values():
        for one, other in combinations(sorted(constraint.variables, key=place.__getitem__), 2):
            pairs[one, other] += 1
    return pairs


def pseudo_tree(team: Team) -> dict[str, str | None]:
    """Return each robot's parent in the pseudo-tree of a depth-first search; None: it is a root.

    The search begins with the robot that has the most neighbours, and goes on to the neighbour that has the most.
    """
    graph = constraint_graph(team)
    order = compute_order(team, Order.DFS)
    place = {name: number for number, name in enumerate(order)}
    above: dict[str, str | None] = {}
    for name in order:
        higher = [other for other in graph[name] if place[other] < place[name]]
        above[name] = max(higher, key=place.__getitem__, default=None)
    return above
