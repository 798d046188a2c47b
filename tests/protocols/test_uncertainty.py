"""Problems with random variables: the best expected and the best worst cost, against all policies in all scenarios."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

import robochoc
from robochoc.communication.kill_schedule import Kill
from robochoc.formats import read_team
from robochoc.formats.dialects.dialect import ExportOptions, ImportOptions, can_state_random_variables
from robochoc.formats.dialects.registry import find_dialect, read_foreign
from robochoc.model.outcome import Verdict
from robochoc.model.policies import Risk
from robochoc.model.uncertainty import is_uncertain
from robochoc.replay import replay
from robochoc.run.options import OnLoss, Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.seats.words import problem_in_words
from tests.support.examples import count, drawn
from tests.support.program import ROOT
from tests.support.replays import identical, recorded
from tests.support.uncertain import frodo_xml, uncertain_problem

GUSTS = ROOT / "docs" / "examples" / "gusts"
SIMULATED = Options(protocol="dpop", runtime=Runtime.SIMULATOR)
PROTOCOLS = ("dpop", "syncbb", "afb", "adopt", "central")


@count("problems", 40, 2000)
def test_costs_equal_those_of_the_best_policy(problems: int) -> None:
    chance = drawn("uncertainty")
    solved = 0
    for number in range(problems):
        problem = uncertain_problem(chance)
        if not is_uncertain(problem.team):
            continue  # no constraint depends on chance
        expected, worst = problem.best()
        protocol = PROTOCOLS[number % len(PROTOCOLS)]
        for risk, wanted in ((Risk.EXPECTED, expected), (Risk.WORST, worst)):
            outcome = solve(problem.team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, risk=risk))
            if wanted is None:
                assert outcome.verdict == Verdict.NO_SOLUTION
                continue
            assert outcome.verdict == Verdict.OPTIMAL
            assert outcome.cost is not None
            assert Fraction(outcome.cost) == wanted
            report = outcome.uncertainty
            assert report is not None
            assert (report.expected if risk == Risk.EXPECTED else report.worst) == outcome.cost
            solved += 1
    assert solved > problems


@count("problems", 15, 300)
def test_problems_of_frodo_cost_the_same(problems: int, tmp_path: Path) -> None:
    chance = drawn("uncertainty of FRODO")
    for number in range(problems):
        problem = uncertain_problem(chance, observed=False)
        if not is_uncertain(problem.team):
            continue
        file = tmp_path / f"{number}.xml"
        file.write_text(frodo_xml(problem, digits=chance.choice([1, 17])))
        team = read_foreign([file], ImportOptions()).team
        constant = Fraction(problem.units.constant, 10**problem.units.places)  # FRODO has no constant
        for risk, best in zip((Risk.EXPECTED, Risk.WORST), problem.best(), strict=True):
            outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR, risk=risk))
            found = None if outcome.cost is None else Fraction(outcome.cost) + constant
            assert found == best


def test_robots_withdraw_if_no_policy_is_possible_in_every_scenario() -> None:
    """A calm day alone is not enough: with wind, the two robots cannot both stay."""
    model = robochoc.Model("crowded")
    one, other = (model.robot(name).variable("place", range(2)) for name in ("one", "other"))
    wind = model.random("wind", {0: 0.9, 1: 0.1}, seen_by=[one])
    model.add(one + wind < 2, other != one, other < 1)
    outcome = model.solve("sfb", withdraw="minimum")
    assert (outcome.verdict, len(outcome.withdrawn)) == (Verdict.OPTIMAL, 1)
    assert outcome.uncertainty is not None
    assert outcome.uncertainty.expected is None


def test_a_recorded_run_is_replayed() -> None:
    chance = drawn("recorded uncertainty")
    for _ in range(4):
        assert identical(replay(recorded(uncertain_problem(chance).team, SIMULATED)))


@pytest.mark.more
def test_processes_and_a_network_give_the_same_policy() -> None:
    team = read_team(GUSTS)
    for runtime in (Runtime.PROCESSES, Runtime.NETWORK):
        for risk, cost in ((Risk.EXPECTED, Fraction(15, 2)), (Risk.WORST, Fraction(12))):
            outcome = solve(team, Options(protocol="dpop", runtime=runtime, risk=risk))
            assert outcome.cost is not None
            assert Fraction(outcome.cost) == cost


@pytest.mark.more
def test_the_others_continue_without_a_lost_robot() -> None:
    team = read_team(GUSTS)
    options = Options(protocol="dpop", on_loss=OnLoss.WITHDRAW, kill=(Kill("Camera", 0.0),))
    outcome = solve(team, options)
    assert outcome.lost == ("Camera",)
    assert outcome.assignment.keys() == {"relay.wind.0", "relay.wind.3"}


def test_exported_to_frodo_and_imported_again_costs_the_same(tmp_path: Path) -> None:
    chance = drawn("uncertainty to FRODO")
    frodo = find_dialect("frodo")
    assert frodo is not None
    assert frodo.write is not None
    for number in range(12):
        problem = uncertain_problem(chance, observed=number % 3 == 0)
        file = tmp_path / f"{number}.xml"
        file.write_bytes(frodo.write(problem.team, ExportOptions()).files["uncertain.xml"])
        again = read_foreign([file], ImportOptions()).team
        assert is_uncertain(again) == can_state_random_variables(problem.team)
        first, second = (solve(one, SIMULATED) for one in (problem.team, again))
        assert first.cost == second.cost
        if is_uncertain(again) and first.uncertainty and second.uncertainty:
            assert first.uncertainty.scenarios == second.uncertainty.scenarios


def test_a_seat_reads_costs_in_the_users_unit() -> None:
    """The blur of a picture costs 3 for each level in wind, which has the probability 0.3."""
    assert "\nCost sharp: 0.1 · (3 · (camera · 3)).\n" in problem_in_words(read_team(GUSTS), "Camera")
