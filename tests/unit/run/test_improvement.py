"""`--improve`: after the deadline the team searches again, and each better decision counts."""

from __future__ import annotations

import itertools
from dataclasses import replace
from types import SimpleNamespace

import pytest

from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.generators.scenario import random_scenario
from robochoc.model.cost_units import CostUnits
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.run import CENTRAL, Options, Runtime, Withdrawal, solve
from robochoc.run.improvement import improvements, is_better, refuse_to_improve
from robochoc.solver.encoding import UnsupportedError
from robochoc.verification.checker import assignment_cost, violations

QUICK = Options(protocol="dsa", runtime=Runtime.SIMULATOR, deadline=60, settings={"cycles": "1"})


@pytest.fixture(autouse=True)
def a_second_a_look(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a second pass whenever the time that is left is looked at: so as many searches are made everywhere."""
    clock = itertools.count()
    monkeypatch.setattr("robochoc.run.improvement.time", SimpleNamespace(monotonic=lambda: float(next(clock))))


def costly(**more: object) -> Team:
    return random_csp(8, 4, 0.6, 0, 1, max_cost=50, **more)  # type: ignore[arg-type]


def test_each_one_is_checked_and_costs_less_than_all_before() -> None:
    team = costly()
    first = solve(team, QUICK)
    found = [first, *improvements(team, QUICK, first, 20)]
    costs = [one.cost for one in found if one.cost is not None]
    assert len(found) == len(costs) > 2
    assert costs == sorted(set(costs), reverse=True)
    assert len({one.seed for one in found}) == len(found)
    for one in found:
        assert one.verified
        assert list(violations(team, one.assignment)) == []
        assert one.cost == assignment_cost(team, one.assignment)


def test_utilities_rise() -> None:
    team = costly(costs=CostUnits(maximize=True, places=0, constant=0))
    first = solve(team, QUICK)
    found = [one.cost for one in (first, *improvements(team, QUICK, first, 20)) if one.cost is not None]
    assert len(found) > 1
    assert found == sorted(found)


def test_the_time_is_over_when_it_is() -> None:
    team = costly()
    first = solve(team, QUICK)
    assert list(improvements(team, QUICK, first, 0.5)) == []


def test_nothing_is_better_than_an_optimum_or_without_costs_than_a_solution() -> None:
    for team, protocol in (
        (costly(), "dpop"),
        (queens3d(3, model="planar"), "sfb"),
        (random_csp(4, 3, 0.5, 0.1), "dsa"),
    ):
        options = replace(QUICK, protocol=protocol, settings={})
        first = solve(team, options)
        assert first.verdict is not Verdict.UNKNOWN
        assert list(improvements(team, options, first, 10)) == []


def outcome(verdict: Verdict, cost: int | None = None, *, verified: bool = True) -> Outcome:
    return Outcome("team", "dsa", Runtime.SIMULATOR, 0, verdict, cost=cost, verified=verified)


def test_what_is_better() -> None:
    team, maximised = costly(), costly(costs=CostUnits(maximize=True, places=0, constant=0))
    known, none = outcome(Verdict.SOLUTION, 5), outcome(Verdict.UNKNOWN)
    assert is_better(team, outcome(Verdict.SOLUTION, 4), known)
    assert not is_better(team, outcome(Verdict.SOLUTION, 5), known)
    assert not is_better(team, outcome(Verdict.SOLUTION, 4, verified=False), known)
    assert not is_better(team, none, known)
    assert is_better(team, outcome(Verdict.SOLUTION, 9), none)
    assert is_better(team, outcome(Verdict.NO_SOLUTION), none)
    assert is_better(maximised, outcome(Verdict.SOLUTION, 6), known)
    assert not is_better(maximised, outcome(Verdict.SOLUTION, 4), known)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (replace(QUICK, deadline=None), "--improve goes on after --deadline"),
        (replace(QUICK, withdraw=Withdrawal.MINIMUM), "--improve is for robots that stay"),
        (replace(QUICK, protocol=CENTRAL), "--improve is for robots that stay"),
    ],
)
def test_what_cannot_be_improved_is_refused(options: Options, why: str) -> None:
    with pytest.raises(UnsupportedError, match=why):
        refuse_to_improve(costly(), options)
    with pytest.raises(UnsupportedError, match="do not change"):
        refuse_to_improve(random_scenario(random_csp(12, 5, 0.5, 0.2), 2, 0.1), QUICK)
