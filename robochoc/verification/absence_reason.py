"""Explains `no-solution` for teams in which robots are absent or must not withdraw."""

from __future__ import annotations

import itertools
import math

from robochoc.model.constraint import INFINITE, Constraint, WhenAbsent
from robochoc.model.problem import Team
from robochoc.verification.checker import MAX_TRIES, constraint_cost

_MOST_NAMED = 3


def absence_reason(team: Team, *, withdrawal: bool = False) -> str:
    """Return a text on the constraints that exclude all solutions because robots are absent; empty if there are none.

    Args:
        team: The team without the robots that were lost or removed.
        withdrawal: True if robots may withdraw.
    """
    constraints = list(team.constraints())
    restated = [one for one in constraints if one.original is not None]
    failing = [one for one in restated if one.when_absent == WhenAbsent.FAIL]
    if failing:
        return f"{_names(failing)} must not lose a robot (when_absent)"
    impossible = [one for one in restated if not _can_hold(one, team)]
    if impossible:
        return f"{_names(impossible)} cannot hold for the robots that are left"
    if withdrawal:
        staying = [one for one in constraints if one.when_absent == WhenAbsent.FAIL]
        return f"the robots of {_names(staying)} must not withdraw (when_absent)" if staying else ""
    return f"{_names(restated)} had to be restated for the robots that are left" if restated else ""


def _can_hold(constraint: Constraint, team: Team) -> bool:
    """Return whether some values satisfy `constraint` alone; True if there are too many values to try."""
    domains = [team.variables[name].domain for name in constraint.variables]
    if math.prod(map(len, domains)) > MAX_TRIES:
        return True
    values = (dict(zip(constraint.variables, row, strict=True)) for row in itertools.product(*domains))
    return any(constraint_cost(constraint, one) < INFINITE for one in values)


def _names(constraints: list[Constraint]) -> str:
    names = list(dict.fromkeys(one.name for one in constraints))
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return f"{', '.join(names[:_MOST_NAMED])}{more}"
