"""The constraints of random binary problems."""

from __future__ import annotations

from robochoc.model.problem import Constraint, Relation, Team


def shared_constraints(team: Team) -> list[Constraint]:
    """Return the constraints between robots of `team`."""
    return [constraint for robot in team.robots for constraint in robot.shared]


def relation_of(constraint: Constraint) -> Relation:
    """Return the relation that defines `constraint`."""
    assert isinstance(constraint.definition, Relation)
    return constraint.definition


def edges_of(team: Team) -> frozenset[tuple[int, int]]:
    """Return the pairs of numbers of variables that a constraint connects."""
    return frozenset((int(a[1:]), int(b[1:])) for a, b in (one.variables for one in shared_constraints(team)))
