"""Tables of constraints over the variables that they name, of robots with several variables."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robochoc.model.problem import Value
from robochoc.solver import cost_table, local_problem, shared_constraint
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.errors import TooLargeError
from robochoc.solver.local_problem import LocalProblem, steps_of
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team
from tests.support.examples import count, drawn
from tests.support.several_variables import random_model
from tests.support.solver_networks import compiled_by_brute_force


@count("teams", 60, 2000)
@pytest.mark.parametrize("withdrawal_cost", [None, 9])
def test_values_that_agree_on_the_named_variables_share_an_entry(teams: int, withdrawal_cost: int | None) -> None:
    smaller = 0
    for number in range(teams):
        parts = agent_problems(
            compiled_by_brute_force(random_complex_cost_team(drawn(f"tables {number}"))),
            RunParameters(withdrawal_cost=withdrawal_cost),
        )
        problems = {name: LocalProblem(part) for name, part in parts.items()}
        values: dict[str, Sequence[Value]] = {name: problem.values for name, problem in problems.items()}
        for name, problem in problems.items():
            others = {other: values[other] for other in values if other != name}
            for table in problem.tables(others):
                for robot, places, coded, size in zip(
                    [*table.agents, name], table.places, table.codes, table.charges.shape, strict=True
                ):
                    named = [tuple([value[place] for place in places]) for value in values[robot]]
                    distinct = list(dict.fromkeys(named))
                    assert size == len(distinct)
                    assert [distinct[code] for code in coded] == named
                joined = table.joined()
                assert joined.shape == tuple([len(values[robot]) for robot in (*table.agents, name)])
                for place in np.ndindex(joined.shape):
                    codes = [one[at] for one, at in zip(table.codes, place, strict=True)]
                    assert joined[place] == table.charges[tuple(codes)]
                smaller += table.charges.size < joined.size
                if table.charges.shape == joined.shape:
                    assert joined is table.charges
    assert smaller


def test_only_the_named_variables_count_for_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    refused = 0
    for number in range(40):
        parts = agent_problems(compiled_by_brute_force(random_complex_cost_team(drawn(f"limit {number}"))))
        problems = {name: LocalProblem(part) for name, part in parts.items()}
        values: dict[str, Sequence[Value]] = {name: problem.values for name, problem in problems.items()}
        tables = [table for problem in problems.values() for table in problem.tables(values)]
        most = max([table.charges.size for table in tables], default=1)
        monkeypatch.setattr(shared_constraint, "MAX_TUPLES", most)
        for part in parts.values():
            LocalProblem(part._replace(known=replace(part.known))).tables(values)
        for table in tables:
            if np.prod([len(codes) for codes in table.codes]) > most:
                with pytest.raises(TooLargeError, match=f"the table of constraint {table.key} has"):
                    table.joined()
                refused += 1
        monkeypatch.undo()
    assert refused


@count("teams", 40, 1000)
def test_rows_that_are_evaluated_together_allow_the_same_values(monkeypatch: pytest.MonkeyPatch, teams: int) -> None:
    for number in range(teams):
        parts = agent_problems(compiled_by_brute_force(random_complex_team(drawn(f"together {number}"))))
        problems = {name: LocalProblem(part) for name, part in parts.items()}
        others = {name: LocalProblem(part._replace(known=replace(part.known))) for name, part in parts.items()}
        values: dict[str, Sequence[Value]] = {name: problem.values for name, problem in problems.items()}
        for name, problem in problems.items():
            for lowest in values:
                if lowest == name:
                    continue
                monkeypatch.setattr(local_problem, "MAX_BOUNDED_ROWS", 0)
                together = others[name].allowed(values, lowest)
                assert others[name].allowed(values, lowest) == together  # without further checks
                monkeypatch.undo()
                one_by_one = problem.allowed(values, lowest)
                assert together == one_by_one
                for table in together:
                    rows = itertools.product(*(range(len(values[robot])) for robot in table.agents))
                    for row, mask in zip(rows, table.joined(), strict=True):
                        codes = [coded[place] for coded, place in zip(table.codes, row, strict=False)]
                        place = sum(step for (step,) in steps_of([[code] for code in codes], table.sizes))
                        assert mask == table.masks[place]
            assert problem.checks == others[name].checks


@count("teams", 40, 1000)
@pytest.mark.parametrize("withdrawal_cost", [None, 9])
def test_costs_that_are_computed_at_once_are_those_of_single_combinations(
    monkeypatch: pytest.MonkeyPatch, teams: int, withdrawal_cost: int | None
) -> None:
    at_once = 0

    def counted(*args: Any) -> bool:  # noqa: ANN401 - those of `fill_at_once`
        nonlocal at_once
        filled = fill(*args)
        at_once += filled and withdrawal_cost is not None and args[1].counts_when_absent
        return filled

    fill = cost_table.fill_at_once
    monkeypatch.setattr(cost_table, "fill_at_once", counted)
    for number in range(teams):
        chance = drawn(f"at once {number}")
        team = random_model(chance, costs=True).team if chance.random() < 0.7 else random_complex_cost_team(chance)
        parts = agent_problems(compiled_by_brute_force(team), RunParameters(withdrawal_cost=withdrawal_cost))
        found = []
        for entries in (0, 10**9):
            monkeypatch.setattr(cost_table, "MIN_ENTRIES", entries)
            problems = {name: LocalProblem(part._replace(known=replace(part.known))) for name, part in parts.items()}
            values: dict[str, Sequence[Value]] = {name: problem.values for name, problem in problems.items()}
            tables = [problem.tables(values) for problem in problems.values()]
            costs = [(table.key, table.charges.tolist()) for made in tables for table in made]
            found.append((costs, [problem.checks for problem in problems.values()]))
        assert found[0] == found[1], number
    assert at_once or withdrawal_cost is None
