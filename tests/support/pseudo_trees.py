"""Teams with costs, and one robot that has its place in a pseudo-tree."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TypeVar

from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.bounding_messages import Context
from robochoc.protocols.shared.dfs import TreeProtocol
from tests.support.agents import robot_of
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of

P = TypeVar("P", bound=TreeProtocol)


Costs = Mapping[str, Sequence[float]]
"""What each combination of values of a scope costs, in lexical order; a scope is the letters of its robots."""


def priced(names: str, costs: Costs, values: Mapping[str, int] = {}) -> Team:
    """A robot for each letter, with the values from 1 to 2, or to its entry in `values`."""
    domains = {name: range(1, values.get(name, 2) + 1) for name in names}

    def constraint(scope: str) -> Constraint:
        rows = tuple(itertools.product(*(domains[name] for name in scope)))
        relation = Relation("R", len(scope), Semantics.SOFT, rows, tuple(costs[scope]))
        return Constraint("C", relation, tuple(scope), tuple(scope))

    return with_costs(team_of(domains, map(constraint, costs)))


def unplaced(protocol: type[P], team: Team, name: str) -> P:
    """The protocol object of one robot, before it has started."""
    return robot_of(protocol, team, name)


def placed(
    protocol: type[P],
    team: Team,
    name: str,
    parent: str | None = None,
    *,
    pseudo_parents: Sequence[str] = (),
    children: Sequence[str] = (),
    pseudo_children: Sequence[str] = (),
) -> P:
    """The protocol object of one robot, when it begins: what it has said is in its outbox."""
    robot = unplaced(protocol, team, name)
    robot.parent, robot.pseudo_parents = parent, tuple(pseudo_parents)
    robot.children, robot.pseudo_children = tuple(children), tuple(pseudo_children)
    robot.placed = True
    robot.start_in_tree()
    robot.settle()
    return robot


def root(protocol: type[P]) -> P:
    """B as the root of a tree of three, when it has begun."""
    team = priced("BCD", {"B": [0, 2], "BC": [0] * 4, "BD": [0] * 4})
    robot = placed(protocol, team, "RB", children=["RC", "RD"])
    robot.outbox.clear()
    return robot


def middle(protocol: type[P]) -> P:
    """B, when it has begun: below A and, further up, Z; its children are C and D."""
    costs = {"ZA": [0] * 4, "ZB": [0, 1, 2, 0], "AB": [0, 3, 1, 0], "BC": [0] * 4, "BD": [0] * 4}
    robot = placed(protocol, priced("ZABCD", costs), "RB", "RA", pseudo_parents=["RZ"], children=["RC", "RD"])
    robot.outbox.clear()
    return robot


def context(**values: int | tuple[int, int]) -> Context:
    """Values of robots, for the first time or with their counters."""
    pairs = {name: entry if isinstance(entry, tuple) else (entry, 1) for name, entry in values.items()}
    return {f"R{name}": ((number,), counter) for name, (number, counter) in pairs.items()}


def to(receiver: str, said: Sequence[tuple[str, Message]]) -> list[Message]:
    """What was said to one robot."""
    return [message for name, message in said if name == receiver]
