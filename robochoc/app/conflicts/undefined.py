"""Constraints that may be undefined for some values: a division by zero forbids them, even in a soft constraint."""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.model.constraint import Constraint, Relation
from robochoc.model.expression import Apply, Expression
from robochoc.model.expression.bounds import Interval, bounds
from robochoc.model.problem import Team


def limits_of(team: Team) -> dict[str, Interval]:
    """Return the minimum and maximum value of each variable with values."""
    domains = {name: one.domain.ranges for name, one in team.variables.items()}
    return {name: Interval(ranges[0][0], ranges[-1][-1]) for name, ranges in domains.items() if ranges}


def can_be_undefined(constraint: Constraint, limits: Mapping[str, Interval]) -> bool:
    """Return whether a constraint may be undefined for some values; the result may be a false positive.

    Args:
        constraint: The constraint.
        limits: The result of `limits_of` for its team. A constraint on a variable without values is defined.
    """
    definition = constraint.definition
    if isinstance(definition, Relation) or not limits.keys() >= {*constraint.variables}:
        return False
    given = [limits[one] if isinstance(one, str) else Interval(one, one) for one in constraint.parameters]
    return _can_be(definition.body, dict(zip(definition.parameters, given, strict=True)))


def _can_be(expression: Expression, limits: Mapping[str, Interval]) -> bool:
    if not isinstance(expression, Apply):
        return False
    operator, arguments = expression.operator, expression.arguments
    if operator == "pow" or any(_can_be(one, limits) for one in arguments):
        return True
    if operator in {"div", "mod"}:
        divisor = bounds(arguments[1], limits)
        return divisor.low <= 0 <= divisor.high
    return False  # results beyond 64 bits are rejected when a team is read (`model/magnitudes.py`)
