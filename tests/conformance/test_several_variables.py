"""Robots with several variables, and constraints over some of them: all complete protocols against brute force."""

from __future__ import annotations

from collections import Counter

import pytest

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.run import Options, Runtime
from robochoc.run.choice import accepts
from robochoc.run.registry import installed_protocols
from robochoc.solver import shared_constraint
from robochoc.solver.errors import TooLargeError, UnsupportedError
from tests.support.examples import are_the_same, count, drawn
from tests.support.loose_problems import minimum_cost
from tests.support.several_variables import random_model, slots_and_tasks

COMPLETE = [
    one.name
    for one in installed_protocols()
    if one.protocol and one.protocol.traits.complete and not one.protocol.traits.encrypted_tables
]


@pytest.mark.parametrize("costs", [False, True])
@count("teams", 5, 100)
def test_complete_protocols_agree_with_brute_force(teams: int, *, costs: bool) -> None:
    seen = Counter[Verdict]()
    for number in range(teams):
        chance = drawn(f"several variables {costs} {number}")
        model = random_model(chance, costs=costs)
        least = minimum_cost(model.team)
        fitting = [name for name in COMPLETE if accepts(name, model.team, Options(runtime=Runtime.SIMULATOR))]
        for protocol in ["auto", *chance.sample(fitting, min(8, len(fitting)))]:
            outcome = model.solve(protocol=protocol, runtime="simulator", seed=number)
            found = outcome.cost if outcome.verdict is not Verdict.NO_SOLUTION else INFINITE
            assert (found or 0) == least, (number, protocol)
            seen[outcome.verdict] += 1
    assert seen.keys() - {Verdict.NO_SOLUTION} == {Verdict.OPTIMAL if costs else Verdict.SOLUTION} or not are_the_same()


def test_a_rule_over_six_slots_is_no_table_over_slots_and_tasks() -> None:
    """The robots have 18 values each: a table over them would have 18^6 entries, a table over slots has 729."""
    model = slots_and_tasks(6, drawn("six slots"))
    outcomes = {
        protocol: model.solve(protocol=protocol, runtime="simulator") for protocol in ("auto", "sfb", "dpop", "ncbb")
    }
    assert {(outcome.verdict, outcome.cost) for outcome in outcomes.values()} == {
        (Verdict.OPTIMAL, outcomes["sfb"].cost)
    }


def test_constraints_whose_tables_are_too_large_are_evaluated_row_by_row(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(key: str, entries: int) -> None:
        if entries > 9:  # a pair of variables with three values
            raise TooLargeError(key)

    monkeypatch.setattr(shared_constraint, "refuse_large", refuse)
    rows = 0
    for number in range(12):
        model = random_model(drawn(f"row by row {number}"), costs=True)
        try:
            outcome = model.solve(protocol="sfb", runtime="simulator")
        except UnsupportedError:  # a constraint over three robots is a table
            continue
        least = minimum_cost(model.team)
        assert (outcome.cost if outcome.verdict is Verdict.OPTIMAL else INFINITE) == least
        rows += 1
    assert rows > 3 or not are_the_same()
