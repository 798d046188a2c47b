"""What is looked at of the parts of asymmetric constraints, and what may be changed without changing a byte sent."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
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
        self,
        prices: list[Cost],
        pairs: list[frozenset[tuple[str, int | None]]],
        seen: set[frozenset[tuple[str, int | None]]],
        *,
        singly: bool,
    ) -> None:
        super().__init__(prices)
        self._pairs = pairs
        self._seen = seen
        self._singly = singly

    def __getitem__(self, index: SupportsIndex) -> Cost:  # type: ignore[override] # nobody asks for a slice
        self._seen.add(self._pairs[index])
        return super().__getitem__(index)

    def __iter__(self) -> Iterator[Cost]:
        if not self._singly:
            self._seen.update(self._pairs)
        return super().__iter__()


def watched_costs(team: Team, monkeypatch: pytest.MonkeyPatch) -> Asked:
    """From now on every look at the costs of a part of a PKC is noted. For robots of one variable."""
    return _watched(team, monkeypatch, frozenset())


Above = Mapping[str, Collection[str]]
"""For each robot those above it that it shares a constraint with."""


def watched_entries(team: Team, monkeypatch: pytest.MonkeyPatch, above: Above | None = None) -> Asked:
    """The same, but of parts of robots `above` each entry is noted only when it is picked out of those of a value."""
    above = above or _before(team)
    return _watched(team, monkeypatch, {part for part in pkc_parts(team) if part[0] in above[part[1]]})


def _before(team: Team) -> Above:
    """For each robot all that have higher priority."""
    return {name: team.order[:place] for place, name in enumerate(team.order)}


def _watched(team: Team, monkeypatch: pytest.MonkeyPatch, singly: Collection[tuple[str, str, str]]) -> Asked:
    asked = defaultdict[tuple[str, str], set[frozenset[tuple[str, int | None]]]](set)
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
        return _Watched(prices, pairs, asked[holder, name], singly=parts[constraint.key] in singly)

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


def what_is_not_needed_changed(team: Team, asked: Asked, chance: Random, above: Above | None = None) -> Team:
    """Entries that nobody picked out are others: of lower robots' parts any, of robots' `above` larger than they were.

    Of these, one least entry of each own value stays.
    """
    higher = above or _before(team)

    def change(robot: Robot, constraint: Constraint) -> Constraint:
        if constraint.model is not ConstraintModel.PKC:
            return constraint
        names = constraint.variables
        owners = [team.owner[name] for name in names]
        (other,) = {*owners} - {robot.name}
        is_above = robot.name in higher[other]
        known = asked.get((robot.name, constraint.name), set())
        listed = rows(team, constraint)
        before = {row: constraint.price(dict(zip(names, row, strict=True))) for row in listed}
        place = owners.index(robot.name)
        kept = {min((row for row in listed if row[place] == own), key=before.__getitem__) for own in
                {row[place] for row in listed}} if is_above else set()  # fmt: skip
        costs = []
        for row in listed:
            drawn = INFINITE if chance.random() < 0.1 else chance.randint(0, MAX_COST)
            if row in kept or frozenset(zip(names, row, strict=True)) in known:
                costs.append(before[row])
            else:
                costs.append(before[row] + drawn if is_above else drawn)
        table = Relation("redrawn", len(names), Semantics.SOFT, tuple(listed), tuple(costs), 0)
        return Constraint(constraint.name, table, names, names, ConstraintModel.PKC)

    return with_constraints(team, change)
