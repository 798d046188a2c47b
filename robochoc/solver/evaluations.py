"""Costs of equal constraints, computed once for all robots of a process.

In large teams, thousands of constraints apply one definition to variables with equal domains. They differ only in the
names of their variables, so they share their computed costs. Robots still count their own checks.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import field
from typing import TYPE_CHECKING

from robochoc.model.constraint import Constraint, Definition
from robochoc.system.lazy_dataclass import dataclass

if TYPE_CHECKING:
    from robochoc.solver.cost_table import CostTable
    from robochoc.solver.encoding import Cost
    from robochoc.solver.shared_constraint import OtherValues


@dataclass(eq=False)
class Evaluations:
    """The results of one definition, with equal terms and domains, for values of the other robots.

    Attributes:
        definition: The definition, which stays alive as long as its `id` is a key.
        costs: The cost of each own value.
        masks: The consistent own values: bit i for the i-th value.
        tables: The number of checks and the table, by the domains of the other robots. Equal constraints have other
            robots and another name.
    """

    definition: Definition
    costs: dict[OtherValues, list[Cost]] = field(default_factory=dict)
    masks: dict[OtherValues, int] = field(default_factory=dict)
    tables: dict[Hashable, tuple[int, CostTable]] = field(default_factory=dict)


class SharedEvaluations:
    """The evaluations of all constraints of a team in this process. They are freed with the team's knowledge."""

    def __init__(self) -> None:
        self._found: dict[Hashable, Evaluations] = {}
        self._numbers: dict[Hashable, int] = {}

    def number(self, values: Hashable) -> int:
        """Return a number for `values`. Equal values have the same number, which is a shorter key."""
        return self._numbers.setdefault(values, len(self._numbers))

    def of(self, constraint: Constraint, names: Sequence[str], domains: Hashable) -> Evaluations:
        """Return the evaluations of `constraint` over the variables `names`.

        Args:
            constraint: The constraint.
            names: The variables, in the order of their values.
            domains: The domains of the variables, or any key that determines them.
        """
        definition = constraint.definition
        place = {name: index for index, name in enumerate(names)}
        terms = tuple([place[term] if isinstance(term, str) else (term,) for term in constraint.parameters])
        key = id(definition), constraint.cost, terms, domains
        found = self._found.get(key)
        if found is None or found.definition is not definition:
            found = self._found[key] = Evaluations(definition)
        return found
