"""Averages of samples instead of expectations: the best average, and the interval for the expected cost."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

import robochoc
from robochoc.cli.reports.outcome import outcome_report
from robochoc.communication.network.profile import profile_of
from robochoc.formats import read_team, write_team
from robochoc.formats.result import read_result, result_json
from robochoc.model.outcome import BEST_FOR_SAMPLES, Verdict
from robochoc.model.policies import Risk
from robochoc.model.problem import AddConstraint, Constraint, ScenarioEvent
from robochoc.model.sampling import Samples, can_be_infinite, sample_number
from robochoc.model.uncertainty import is_uncertain
from robochoc.replay import replay
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import OptionError
from robochoc.verification import policies
from tests.support.examples import count, drawn
from tests.support.replays import identical, recorded
from tests.support.uncertain import uncertain_problem

SIMULATED = Options(protocol="dpop", runtime=Runtime.SIMULATOR)
PROTOCOLS = ("dpop", "syncbb", "afb", "adopt", "central")


def fleet(gusts: int = 7) -> robochoc.Model:
    """Return a model in which one cost depends on all gusts, each of which has four outcomes."""
    model = robochoc.Model("fleet")
    strengths = [model.random(f"g{number}", {0: 0.4, 1: 0.3, 2: 0.2, 3: 0.1}) for number in range(gusts)]
    one, other = (model.robot(name).variable("h", range(1, 6)) for name in ("one", "other"))
    model.minimize(abs(sum(strengths) - 4 * one) + 3 * abs(other * 2 - strengths[0]))
    model.add(one != other)
    return model


@count("problems", 8, 2000)
def test_costs_are_those_of_the_best_policy_for_the_samples(problems: int) -> None:
    chance = drawn("samples")
    for number in range(problems):
        problem = uncertain_problem(chance)
        if not is_uncertain(problem.team):
            continue
        seed, samples = number, chance.choice([1, 2, 2, 4, 1000])
        options = Options(
            protocol=PROTOCOLS[number % len(PROTOCOLS)], runtime=Runtime.SIMULATOR, samples=samples, seed=seed
        )
        wanted = problem.best_for(Samples(samples, seed, samples))
        outcome = solve(problem.team, options)
        if wanted is None:
            assert outcome.verdict == Verdict.NO_SOLUTION
            continue
        assert outcome.cost is not None
        assert Fraction(outcome.cost) == wanted
        report = outcome.uncertainty
        assert report is not None
        if report.sampled:
            assert (outcome.verdict, outcome.reason) == (Verdict.SOLUTION, BEST_FOR_SAMPLES)
            assert report.sampled.cost == outcome.cost
        else:
            assert (outcome.verdict, report.expected) == (Verdict.OPTIMAL, outcome.cost)
        assert report.expected is not None
        assert samples < 1000 or wanted == problem.best()[0]


def test_many_outcomes_are_sampled_and_the_expected_cost_is_in_the_interval(monkeypatch: pytest.MonkeyPatch) -> None:
    team = fleet().team
    exact = solve(team, SIMULATED).uncertainty
    monkeypatch.setattr(policies, "MOST_EXACT", 0)
    outcome = solve(team, SIMULATED)
    report = outcome.uncertainty
    assert exact is not None
    assert exact.expected is not None
    assert report is not None
    assert report.sampled is not None
    assert (outcome.verdict, report.expected, report.sampled.samples) == (Verdict.SOLUTION, None, 1000)
    assert report.sampled.low is not None
    assert report.sampled.high is not None
    assert report.sampled.low < exact.expected < report.sampled.high
    assert report.sampled.high - report.sampled.low < 0.4
    text = outcome_report(team, outcome)
    assert f"cost {outcome.cost} (the best for the samples)" in text
    assert f"for 1,000 samples; expected cost {report.sampled.low} to {report.sampled.high} (95 % confidence" in text
    assert read_result(result_json(outcome)).uncertainty == report


def test_a_seed_determines_the_samples() -> None:
    team = fleet(3).team
    first, again, other = (solve(team, replace(SIMULATED, samples=10, seed=seed)).cost for seed in (1, 1, 2))
    assert first == again != other


def test_outcomes_that_were_not_drawn_are_never_violated() -> None:
    """Gust 1 has the probability 0.001, so that two samples do not contain it; without it, place 0 would be best."""
    model = robochoc.Model("rare")
    place = model.robot("one").variable("place", range(3))
    gust = model.random("gust", {0: 0.998, 1: 0.001, 5: 0.001})
    model.minimize(10 // (place + 1 - gust) + 10 * place)
    solution = model.solve("dpop", samples=2)
    assert solution.uncertainty is not None
    assert solution.uncertainty.sampled is not None
    assert solution["one.place"] == 1, "a cost is undefined if the gust is 1"


@pytest.mark.parametrize("runtime", [Runtime.PROCESSES, pytest.param(Runtime.NETWORK, marks=pytest.mark.more)])
def test_every_runtime_finds_the_same_answer(runtime: Runtime) -> None:
    team = fleet(3).team
    sampled = replace(SIMULATED, samples=20)
    outcome, expected = (solve(team, replace(sampled, runtime=one)) for one in (runtime, Runtime.SIMULATOR))
    assert (outcome.cost, outcome.verdict, outcome.reason) == (expected.cost, Verdict.SOLUTION, BEST_FOR_SAMPLES)


def test_listed_optima_are_those_of_the_samples() -> None:
    team = fleet(3).team
    outcome = solve(team, replace(SIMULATED, protocol="list-dpop", samples=20))
    assert "there is no other optimum of the samples" in outcome_report(team, outcome)


def test_a_recorded_run_with_samples_is_replayed() -> None:
    assert identical(replay(recorded(fleet(3).team, replace(SIMULATED, samples=20, seed=4))))


def test_events_have_the_costs_of_samples() -> None:
    team = fleet(2).team
    radio = next(one for robot in team.robots for one in robot.shared)
    added = Constraint("added", radio.definition, radio.scope, radio.parameters, cost=7)
    lower = next(robot for robot in team.robots if robot.parents)
    change = AddConstraint(lower.name, lower.parents[0].name, added)
    changing = replace(team, scenario=(ScenarioEvent((change,)),))
    outcome = solve(changing, replace(SIMULATED, samples=8))
    assert [epoch.reason for epoch in outcome.epochs] == [BEST_FOR_SAMPLES] * 2
    assert outcome.epochs[0].cost == outcome.epochs[1].cost == solve(team, replace(SIMULATED, samples=8)).cost


def test_a_team_with_many_outcomes_is_written_and_read_again(tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("written") / "fleet"
    team = fleet().team
    write_team(team, folder)
    again = read_team(folder)
    assert is_uncertain(again)
    assert again.robots == team.robots
    assert [profile_of(robot).sampled for robot in again.robots] == [True, False]


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"verify": True}, "are only the best for samples"),
        ({"risk": Risk.WORST, "samples": 10}, "not the worst case"),
        ({"risk": Risk.WORST}, "use --risk expected"),
    ],
)
def test_estimates_prove_nothing(options: dict[str, object], why: str) -> None:
    with pytest.raises(UnsupportedError, match=why):
        solve(fleet(10).team, replace(SIMULATED, **options))  # type: ignore[arg-type]


def test_powers_and_quotients_by_numbers_are_sampled() -> None:
    model = robochoc.Model("powers")
    gust = model.random("gust", {0: 0.5, 1: 0.3, 3: 0.2})
    place = model.robot("one").variable("place", range(1, 4))
    model.minimize((gust + place) ** 2 // 3 + abs(gust * 2 - place))
    assert not any(map(can_be_infinite, model.team.constraints()))
    model.minimize(6 // (place + gust))
    assert any(map(can_be_infinite, model.team.constraints()))


def test_samples_need_random_variables() -> None:
    model = robochoc.Model("calm")
    model.minimize(model.robot("one").variable("place", range(3)))
    with pytest.raises(UnsupportedError, match="calm has no random variables, so that --samples cannot be used"):
        solve(model.team, replace(SIMULATED, samples=10))


def test_the_number_of_samples_divides_a_power_of_ten() -> None:
    assert sample_number(500) == 500
    with pytest.raises(ValueError, match="use 320 samples"):
        sample_number(300)
    with pytest.raises(OptionError, match="samples: 0 is not a number of samples"):
        Options(samples=0)
