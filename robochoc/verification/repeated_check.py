"""Checks many assignments of one team. The cost of a constraint is computed once for each combination of values."""

from __future__ import annotations

import math

from robochoc.model.problem import INFINITE, Assignment, Constraint, Team
from robochoc.verification.checker import constraint_cost

MAX_KNOWN = 4096
"""The maximum number of combinations of values of a constraint whose costs are stored."""


class RepeatedCheck:
    """The constraints of a team, with the costs that `constraint_cost` has computed so far."""

    def __init__(self, team: Team) -> None:
        self._domains = [*team.variables.items()]
        size = {name: len(variable.domain) for name, variable in self._domains}
        self._constraints: list[tuple[Constraint, tuple[str, ...], dict[tuple[int, ...], float] | None]] = []
        for constraint in team.constraints():
            names = tuple(constraint.variables)
            known: dict[tuple[int, ...], float] = {}
            few = math.prod(size[name] for name in names) <= MAX_KNOWN
            self._constraints.append((constraint, names, known if few else None))

    def cost(self, assignment: Assignment) -> float:
        """Return the cost of values for all variables; infinite if it is not a solution."""
        if len(assignment) != len(self._domains):
            return INFINITE
        if not all(name in assignment and assignment[name] in variable.domain for name, variable in self._domains):
            return INFINITE
        total: float = 0
        for constraint, names, known in self._constraints:
            values = tuple([assignment[name] for name in names])
            cost = None if known is None else known.get(values)
            if cost is None:
                cost = constraint_cost(constraint, assignment)
                if known is not None:
                    known[values] = cost
            total += cost
        return total
