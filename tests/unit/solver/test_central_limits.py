"""The central solver on costs when the time is over: the best so far, and what is proven of the rest."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import pytest

from robochoc.formats import PREDEFINED
from robochoc.generators.coloring import coloring
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Constraint, Relation, Semantics
from robochoc.run import Options, solve
from robochoc.run.incumbent import robots_without_values
from robochoc.solver.ace import AceProcess
from robochoc.solver.central import CentralAnswer, CentralSolver
from robochoc.solver.encoding import Codes, Network, Table
from robochoc.solver.failures import SolverTimeoutError
from robochoc.solver.weighted import weighted_components
from robochoc.verification.checker import assignment_cost, violations
from tests.support.clocks import once, waiting
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of

CENTRAL = Options(protocol="central")
HARD = random_csp(30, 8, 0.3, 0, 1, max_cost=100)
"""Hours would not do."""


@pytest.fixture
def warm() -> Iterator[AceProcess]:
    with AceProcess(always=True) as one:
        solve(coloring(3, 2, 2), CENTRAL, solver=one)
        yield one


def test_when_the_time_is_over_the_best_so_far_is_told(warm: AceProcess) -> None:
    team = HARD

    def solved(limit: float) -> Outcome:
        with waiting(limit + 9):
            return solve(team, replace(CENTRAL, timeout=limit), solver=warm)

    outcome = once(lambda outcome: bool(outcome.assignment), solved)
    assert outcome.verdict is Verdict.UNKNOWN
    assert outcome.bound is not None
    assert outcome.cost == assignment_cost(team, outcome.assignment) > outcome.bound
    assert outcome.verified


def test_without_an_answer_until_then_there_is_a_bound() -> None:
    """Of two parts one is seen through without ACE."""
    unary = Relation("U", 1, Semantics.SOFT, ((1,), (2,)), (5, 4), 0)
    differ = Constraint("D", PREDEFINED["ne"], ("A", "B"), ("A", "B"), cost=3)
    domains = {"A": (1, 2), "B": (1, 2), "C": (1, 2)}
    team = with_costs(team_of(domains, [differ, Constraint("U", unary, ("C",), ("C",))]))
    judgement = CentralSolver(deadline=time.monotonic()).solve(team)
    assert judgement == CentralAnswer(Verdict.UNKNOWN, bound=4)


def test_what_was_found_for_another_task_is_not_told(warm: AceProcess) -> None:
    rows = tuple((a, b, (a + b) % 3) for a in range(3) for b in range(3))
    network = Network(((0, 1, 2), (0, 1, 2), (0, 1, 2)), (Table((0, 1, 2), allowed=True, rows=rows),))
    assert warm.begin(network, costs=(2,))
    assert warm.answer().solutions[0] in rows
    for _ in range(3):
        assert warm.begin(network, costs=(2,))
        best = warm.give_up().best
        assert best is None or best in rows


def test_a_task_that_is_given_up_has_a_best_once_ace_has_one(warm: AceProcess) -> None:
    team = HARD
    (part,) = weighted_components(team.variables.values(), list(team.constraints()))

    def best_of(limit: float) -> Codes | None:
        warm.begin(part.network, costs=part.costs)
        with pytest.raises(SolverTimeoutError) as over:
            warm.answer(time.monotonic() + limit)
        return over.value.best

    best = once(lambda best: best is not None, best_of)
    assert best is not None
    assert part.cost(best) == assignment_cost(team, part.decoded(best))


def test_when_the_time_is_over_those_who_stay_so_far_are_told(warm: AceProcess) -> None:
    team = queens3d(6)
    judgement = once(
        lambda judgement: bool(judgement.assignment),
        lambda limit: CentralSolver(deadline=time.monotonic() + limit, solver=warm).solve(team, withdrawal_cost=1),
    )
    away = robots_without_values(team, judgement.assignment)
    assert judgement.verdict is Verdict.UNKNOWN
    assert judgement.cost == len(away) == 36 - len(judgement.assignment)
    assert not list(violations(team, judgement.assignment, away))
