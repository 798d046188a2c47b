"""Changes by which a decision that a robot has carried out remains valid."""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.model.constraint import Constraint
from robochoc.model.problem import RemoveValue, Team

PAIRS_MAX = 10_000
"""The size of the largest domain whose values are tried one by one."""
_PAIR = 2


def changes_of_fixed(team: Team, variable: str, value: int) -> Iterator[RemoveValue]:
    """Yield the removal of all other values of `variable`, and of the values of others that exclude `value`.

    Only hard constraints over `variable` and one other variable are considered.
    """
    domain = team.variables[variable].domain
    if value not in domain or len(domain) > PAIRS_MAX:
        return
    yield from (RemoveValue(variable, other) for other in domain if other != value)
    removed = set()
    for constraint in _pairs(team, variable):
        other = next(name for name in constraint.variables if name != variable)
        for their in team.variables[other].domain if len(team.variables[other].domain) <= PAIRS_MAX else ():
            if (other, their) not in removed and not constraint.allows({variable: value, other: their}):
                removed.add((other, their))
                yield RemoveValue(other, their)


def _pairs(team: Team, variable: str) -> Iterator[Constraint]:
    for constraint in team.constraints():
        names = {*constraint.variables}
        if variable in names and len(names) == _PAIR and names <= team.variables.keys() and constraint.is_hard:
            yield constraint
