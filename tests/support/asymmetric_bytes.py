"""What is looked at of the parts of asymmetric constraints, and what may be changed without changing a byte sent."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from random import Random
from typing import SupportsIndex

import pytest

from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Relation, Robot, Semantics, Team
from robochoc.solver.encoding import Cost
from robochoc.solver.shared_constraint import OtherValues, SharedConstraint
from tests.support.cost_problems import MAX_COST
from tests.support.pkc_bytes import Asked
from tests.support.pkc_problems import pkc_parts, rows, with_constraints


class _Watched(list[Cost]):
    """The costs of each own value, with a note of each that is looked at."""

    def __init__(
        self, prices: list[Cost], pairs: list[frozenset[tuple[str, int]]], seen: set[frozenset[tuple[str, int]]]
    ) -> None:
        super().__init__(prices)
        self._pairs = pairs
        self._seen = seen

    def __getitem__(self, index: SupportsIndex) -> Cost:  # type: ignore[override] # nobody asks for a slice
        self._seen.add(self._pairs[index])
        return super().__getitem__(index)

    def __iter__(self) -> Iterator[Cost]:
        self._seen.update(self._pairs)
        return super().__iter__()


def watched_costs(team: Team, monkeypatch: pytest.MonkeyPatch) -> Asked:
    """From now on every look at the costs of a part of a PKC is noted. For robots of one variable."""
    asked = defaultdict[tuple[str, str], set[frozenset[tuple[str, int]]]](set)
    parts = {}
    for holder, other, name in pkc_parts(team):
        parts[f"{holder}<{other}:{name}"] = parts[f"{holder}>{other}:{name}"] = (holder, other, name)
    plain = SharedConstraint.costs

    def costs(constraint: SharedConstraint, others: OtherValues) -> list[Cost]:
        prices = plain(constraint, others)
        if constraint.key not in parts:
            return prices
        holder, other, name = parts[constraint.key]
        (seen,) = others
        pairs = []
        for index in range(len(prices)):
            (own,) = constraint.own_part(index)
            assert own is not None
            pairs.append(frozenset({(team[holder].variables[0].name, own), (team[other].variables[0].name, seen)}))
        return _Watched(prices, pairs, asked[holder, name])

    monkeypatch.setattr(SharedConstraint, "costs", costs)
    return asked


def costs_changed(team: Team, asked: Asked, chance: Random, *, there: bool = False) -> Team:
    """Parts of PKCs charge anything, or forbid, where nobody asked (`there`: where somebody did)."""

    def change(robot: Robot, constraint: Constraint) -> Constraint:
        if constraint.model is not ConstraintModel.PKC:
            return constraint
        known = asked.get((robot.name, constraint.name), set())
        names = constraint.variables
        listed = rows(team, constraint)
        costs = []
        for row in listed:
            values = dict(zip(names, row, strict=True))
            redrawn = (frozenset(values.items()) in known) is there
            drawn = INFINITE if chance.random() < 0.1 else chance.randint(0, MAX_COST)
            costs.append(drawn if redrawn else constraint.price(values))
        table = Relation("redrawn", len(names), Semantics.SOFT, tuple(listed), tuple(costs), 0)
        return Constraint(constraint.name, table, names, names, ConstraintModel.PKC)

    return with_constraints(team, change)
