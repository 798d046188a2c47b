"""Total priority orders, and teams with other priorities (`robochoc solve --order`).

The files of a team define the priorities, which determine the speed of a protocol. The static orders are those compared
by Dechter and Meiri ("Experimental evaluation of preprocessing algorithms for constraint satisfaction problems", AIJ
68, 1994, Section 3: minimum width, maximum degree, depth-first search), and dom/deg (Bessiere and Regin, "MAC and
combined
heuristics: two reasons to forsake FC (and CBJ?) on hard problems", CP 1996).

The functions are pure: they return a team with the same problem and different links.
"""

from __future__ import annotations

import heapq
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import assert_never

from robochoc.model.priorities import natural_key, priority_order
from robochoc.model.problem import Child, Constraint, ConstraintModel, Parent, Robot, Team
from robochoc.system.errors import RobochocError

Graph = Mapping[str, frozenset[str]]
"""The neighbours of each robot."""


class Order(StrEnum):
    """The names of orders. Ties are broken by natural order of names. `given` is the order of the files."""

    GIVEN = "given"
    LEXICOGRAPHIC = "lexicographic"
    MAX_DEGREE = "max-degree"
    MIN_WIDTH = "min-width"
    DOM_DEG = "dom-deg"
    DFS = "dfs"
    RANDOM = "random"


class OrderError(RobochocError):
    """Raised if a team cannot be reordered. The message is a sentence with the reason."""


def with_order(team: Team, order: Order | Sequence[str] | None, seed: int = 0) -> Team:
    """Return `team` in the given priority order.

    Args:
        team: The team.
        order: The name of an order, or the names of all robots. None: the team stays unchanged.
        seed: The seed for the order `random`.

    Raises:
        OrderError: if the team cannot be reordered.
    """
    if order is None:
        return team
    return with_priorities(team, compute_order(team, order, seed) if isinstance(order, Order) else order)


def compute_order(team: Team, order: Order, seed: int = 0) -> tuple[str, ...]:
    """Return the names of the robots of `team` in the given order, highest priority first.

    Args:
        team: The team.
        order: The name of the order.
        seed: The seed for the order `random`.
    """
    graph = constraint_graph(team)
    match order:
        case Order.GIVEN:
            names = team.order
        case Order.LEXICOGRAPHIC:
            names = _lexicographic(graph)
        case Order.MAX_DEGREE:
            names = _max_degree(graph)
        case Order.MIN_WIDTH:
            names = _min_width(graph)
        case Order.DOM_DEG:
            names = _dom_deg(graph, team)
        case Order.DFS:
            names = _depth_first(graph)
        case Order.RANDOM:
            names = _random(graph, seed)
        case never:
            assert_never(never)
    return names


def with_dom_deg_order(team: Team) -> Team:
    """Return `team` in the order `dom-deg`, which finds withdrawals fast. Unchanged if the team cannot be reordered."""
    try:
        return with_order(team, Order.DOM_DEG)
    except OrderError:
        return team


def constraint_graph(team: Team) -> Graph:
    """Return the neighbours of each robot: robots that share a constraint with it, or are linked to it in the files."""
    near: dict[str, set[str]] = {robot.name: set() for robot in team.robots}
    for robot in team.robots:
        groups = [_owners(team, constraint) for constraint in robot.shared]
        groups += [{robot.name, parent.name} for parent in robot.parents]
        for group in groups:
            for name in group:
                near[name] |= group - {name}
    return {name: frozenset(others) for name, others in near.items()}


# The orders


def _lexicographic(graph: Graph) -> tuple[str, ...]:
    """Return the robots by natural name order: `Robot2.1` before `Robot10.1`."""
    return tuple(sorted(graph, key=natural_key))


def _max_degree(graph: Graph) -> tuple[str, ...]:
    """Return the robots sorted by the number of neighbours, in descending order."""
    return tuple(sorted(graph, key=lambda name: (-len(graph[name]), natural_key(name))))


def _min_width(graph: Graph) -> tuple[str, ...]:
    """Return a minimum-width order, built from its end: the robot with the fewest remaining neighbours comes last.

    Freuder, "A sufficient condition for backtrack-free search", JACM 29, 1982: no order has a smaller width (the
    largest number of neighbours above a robot).
    """
    place = {name: number for number, name in enumerate(_lexicographic(graph))}
    left = {name: set(others) for name, others in graph.items()}
    waiting = [(len(others), -place[name], name) for name, others in left.items()]
    heapq.heapify(waiting)
    backwards = []
    while waiting:
        degree, _, last = heapq.heappop(waiting)
        if last not in left or degree != len(left[last]):
            continue  # the heap has another entry for this robot, with fewer neighbours
        for other in left.pop(last):
            left[other].discard(last)
            heapq.heappush(waiting, (len(left[other]), -place[other], other))
        backwards.append(last)
    return tuple(reversed(backwards))


def _depth_first(graph: Graph) -> tuple[str, ...]:
    """Return the order in which a depth-first search visits the robots. It induces the pseudo-tree of that search.

    The search starts with the robot that has the most neighbours, continues with its neighbour that has the most, and
    restarts in each further component of the graph. Pseudo-trees: Freuder and Quinn, "Taking advantage of stable sets
    of variables in constraint satisfaction problems", IJCAI 1985.
    """
    by_degree = _max_degree(graph)
    place = {name: number for number, name in enumerate(by_degree)}
    met: dict[str, None] = {}
    for root in by_degree:
        walk = [iter([root])]
        while walk:
            name = next((name for name in walk[-1] if name not in met), None)
            if name is None:
                walk.pop()
            else:
                met[name] = None
                walk.append(iter(sorted(graph[name], key=place.__getitem__)))
    return tuple(met)


def _dom_deg(graph: Graph, team: Team) -> tuple[str, ...]:
    """Return the robots sorted by domain size per neighbour, in ascending order. Robots without neighbours are last.

    The domain is the declared one; for a robot with several variables, it consists of all combinations of their values.
    The values allowed by private constraints are known only after compilation.
    """
    from fractions import Fraction  # noqa: PLC0415 - start-up: no other order needs it

    size = {robot.name: math.prod(len(variable.domain) for variable in robot.variables) for robot in team.robots}

    def key(name: str) -> tuple[bool, Fraction, object]:
        degree = len(graph[name])
        return not degree, Fraction(size[name], degree or 1), natural_key(name)

    return tuple(sorted(graph, key=key))


def _random(graph: Graph, seed: int) -> tuple[str, ...]:
    """Return a random order, each as likely as any other.

    Only `Random.random` is used, since Python guarantees that its results never change.
    """
    from random import Random  # noqa: PLC0415 - once imported, it draws a new state in each forked process

    chance = Random(seed)  # noqa: S311 - an order, not a secret
    lots = {name: chance.random() for name in _lexicographic(graph)}
    return tuple(sorted(lots, key=lambda name: (lots[name], natural_key(name))))


# The team with other priorities


def with_priorities(team: Team, names: Sequence[str]) -> Team:
    """Return `team` with the priorities of `names`, highest first. Constraints and solutions stay the same.

    A totally known constraint moves to the robot in its scope that is now the lowest; the other robots in the scope are
    parents of that robot. Links without a constraint stay, and are reversed if necessary. Children know the variables
    that their constraints need, and the variables listed in the files if the link was not reversed. So the team is as
    if its author had written it with these priorities. Robots that are not linked may be in any order.

    Args:
        team: The team.
        names: The names of all robots in the team, each exactly once.

    Raises:
        OrderError: if the holder of a partially known constraint would change, or the team has a scenario.
        ValueError: if `names` differ from the robots' names.
    """
    if sorted(names) != sorted(team.order):
        raise ValueError(f"the order must name each robot of {team.name} once")
    if tuple(names) == team.order:
        return team
    if team.dynamic:
        raise OrderError(f"{team.name} has a scenario.xml, which refers to its links: solve it in the given order")
    return _Reordering(team, names).team()


class _Reordering:
    """Computes the new links of a team with other priorities, and the new holders of its constraints."""

    def __init__(self, team: Team, names: Sequence[str]) -> None:
        self._old = team
        self._rank = {name: place for place, name in enumerate(names)}
        self._held: dict[str, list[Constraint]] = {name: [] for name in names}
        for robot in team.robots:
            for constraint in robot.shared:
                self._held[self._holder(robot, constraint)].append(constraint)
        self._needed_before = {robot.name: _needed(team, robot.name, robot.shared) for robot in team.robots}
        self._needed = {name: _needed(team, name, held) for name, held in self._held.items()}
        self._parents = {name: set(needed) for name, needed in self._needed.items()}
        for parent, child in self._lasting_links():
            higher, lower = sorted((parent, child), key=self._rank.__getitem__)
            self._parents[lower].add(higher)
        self._children: dict[str, set[str]] = {name: set() for name in names}
        for name, above in self._parents.items():
            for parent in above:
                self._children[parent].add(name)
        # Readers of files compute the order from the links, and expect a constraint under its lowest parent.
        self._seen = {name: place for place, name in enumerate(priority_order(self._parents))}

    def team(self) -> Team:
        """Return the team with the new priorities."""
        return replace(self._old, robots=tuple(map(self._robot, self._rank)))

    def _holder(self, robot: Robot, constraint: Constraint) -> str:
        """Return the new holder of `constraint`, which was held by `robot`."""
        if constraint.model == ConstraintModel.PKC:
            return robot.name
        return max(_owners(self._old, constraint), key=self._rank.__getitem__)

    def _lasting_links(self) -> Iterator[tuple[str, str]]:
        """Yield the parent and the child of each link that stays even without totally known constraints."""
        for robot in self._old.robots:
            needed = self._needed_before[robot.name]
            for parent in robot.parents:
                below = _child(self._old[parent.name], robot.name)
                parts = [one for one in (*parent.constraints, *below.constraints) if one.model == ConstraintModel.PKC]
                if parts and self._rank[robot.name] < self._rank[parent.name]:
                    raise OrderError(
                        f"{robot.name} shares a partially known constraint (PKC, {parts[0].name}) with its parent"
                        f" {parent.name}; such links are not reversed: choose an order with {parent.name} before it"
                    )
                listed = set(below.variables)
                if parts or parent.name not in needed or listed - needed[parent.name]:
                    yield parent.name, robot.name

    def _robot(self, name: str) -> Robot:
        old = self._old[name]
        under: dict[str, list[Constraint]] = defaultdict(list)
        unmoved = set(map(id, old.shared))
        for constraint in self._held[name]:
            others = _owners(self._old, constraint) - {name}
            moved = replace(constraint, line=0) if constraint.line and id(constraint) not in unmoved else constraint
            under[max(others, key=self._seen.__getitem__)].append(moved)
        parents = {parent.name: parent for parent in old.parents}
        children = {child.name: child for child in old.children}
        return replace(
            old,
            parents=tuple(
                Parent(parent, tuple(under[parent]), parents[parent].line if parent in parents else 0)
                for parent in self._listed(parents, self._parents[name])
            ),
            children=tuple(
                self._with_needed_variables(old, children.get(child) or Child(child))
                for child in self._listed(children, self._children[name])
            ),
        )

    def _listed(self, before: Mapping[str, object], now: set[str]) -> list[str]:
        """Return the names in `now`: first those listed before, in their old order, then the new names by priority."""
        return [*(name for name in before if name in now), *sorted(now - before.keys(), key=self._rank.__getitem__)]

    def _with_needed_variables(self, robot: Robot, child: Child) -> Child:
        """Return `child` with the variables of `robot` that the child must know now."""
        needs_now = self._needed[child.name].get(robot.name, set())
        needed_before = self._needed_before[child.name].get(robot.name, set())
        remaining = [name for name in child.variables if name in needs_now or name not in needed_before]
        own = [variable.name for variable in robot.variables if variable.name in needs_now]
        variables = tuple(dict.fromkeys([*remaining, *own]))
        return child if variables == child.variables else replace(child, variables=variables)


def _child(parent: Robot, name: str) -> Child:
    return next(child for child in parent.children if child.name == name)


def _owners(team: Team, constraint: Constraint) -> set[str]:
    return {team.owner[variable] for variable in constraint.variables}


def _needed(team: Team, name: str, constraints: Sequence[Constraint]) -> dict[str, set[str]]:
    """Return, for each other robot, its variables in those `constraints` that the robot `name` holds."""
    needed: dict[str, set[str]] = defaultdict(set)
    for constraint in constraints:
        for variable in constraint.variables:
            if team.owner[variable] != name:
                needed[team.owner[variable]].add(variable)
    return dict(needed)
