"""Teams with costs, and one robot that has its place in a pseudo-tree."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TypeVar

from cost_problems import with_costs
from problems import team_of

from robochoc.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.dfs import TreeProtocol
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.compiled import LocalProblem
from robochoc.solver.part import parts

P = TypeVar("P", bound=TreeProtocol)


def priced(names: str, costs: Mapping[str, Sequence[float]], values: int = 2) -> Team:
    """A robot for each letter, with the values from 1 on; `costs` of each combination of a scope, in lexical order."""

    def constraint(scope: str) -> Constraint:
        rows = tuple(itertools.product(range(1, values + 1), repeat=len(scope)))
        relation = Relation("R", len(scope), Semantics.SOFT, rows, tuple(costs[scope]))
        return Constraint("C", relation, tuple(scope), tuple(scope))

    return with_costs(team_of({name: range(1, values + 1) for name in names}, map(constraint, costs)))


def unplaced(protocol: type[P], team: Team, name: str) -> P:
    """The protocol object of one robot, before it has started."""
    return protocol(LocalProblem(parts(team, everywhere=True)[name]), PriorityOrder(team.order))


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
    robot.begin()
    robot.settle()
    return robot
