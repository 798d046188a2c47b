"""`--deadline`: at that time, the best that satisfies all hard constraints is the answer."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from random import Random

import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.communication.search_result import SearchResult
from robochoc.formats.result import read_result, result_json
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, RemoveValue, ScenarioEvent, Team
from robochoc.protocols.findings import Findings
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.evaluation import Search, check_with_files, evaluate_search
from robochoc.run.phases import first_phase
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.compiled_team import ensure_compiled
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import assignment_cost, violations
from tests.support.brute_force import least_cost, priced_solutions
from tests.support.cost_problems import random_cost_team
from tests.support.examples import count
from tests.support.problems import random_team

BY_S = 0.4


def hard_to_prove() -> Team:
    """A team whose least cost nobody proves in the time of a test."""
    return random_csp(24, 8, 0.6, 0.0, seed=1, max_cost=100)


@pytest.mark.usefixtures("a_second_a_look")
@pytest.mark.parametrize("protocol", ["bnb-adopt", "syncbb", "dsa"])
def test_what_is_known_by_then_is_a_solution_and_never_an_optimum(protocol: str) -> None:
    by_its_deadline(protocol, Runtime.SIMULATOR, 1000)


@pytest.mark.slow
@pytest.mark.parametrize("protocol", ["syncbb", "dsa"])
def test_what_processes_know_by_then_is_a_solution_and_never_an_optimum(protocol: str) -> None:
    by_its_deadline(protocol, Runtime.PROCESSES, 20)


def by_its_deadline(protocol: str, runtime: Runtime, by_s: float) -> None:
    team = hard_to_prove()
    settings = {"cycles": "1000000"} if protocol == "dsa" else {}
    outcome = solve(team, Options(protocol=protocol, runtime=runtime, deadline=by_s, settings=settings))
    assert (outcome.verdict, outcome.deadline, outcome.verified) == (Verdict.SOLUTION, by_s, True)
    assert list(violations(team, outcome.assignment)) == []
    assert outcome.cost == assignment_cost(team, outcome.assignment)
    assert outcome.bound is None or outcome.bound <= outcome.cost
    report = outcome_report(team, outcome)
    assert f"by the deadline of {by_s:g} s (not proven to be the minimum" in report
    assert read_result(result_json(outcome)).deadline == outcome.deadline


def test_without_a_solution_by_then_nothing_is_said() -> None:
    """A team that has no solution, and where `sbt` takes more than 300,000 messages to find that out."""
    team = random_csp(40, 10, 0.5, 0.35, seed=1)
    outcome = solve(team, Options(protocol="sbt", runtime=Runtime.SIMULATOR, deadline=BY_S))
    assert (outcome.verdict, outcome.assignment, outcome.deadline) == (Verdict.UNKNOWN, {}, None)
    assert outcome.reason == (
        "by the deadline (--deadline 0.4) the robots knew no assignment that satisfies all hard constraints"
    )


@pytest.mark.usefixtures("a_second_a_look")
def test_each_epoch_has_the_same_time() -> None:
    """A scenario's epoch that the deadline ends has an answer, and the next event comes."""
    team = random_csp(6, 3, 0.6, 0.0, seed=1, max_cost=9)
    event = ScenarioEvent((RemoveValue(team.robots[0].variables[0].name, 2),))
    options = Options(protocol="dsa", runtime=Runtime.SIMULATOR, deadline=100, settings={"cycles": "1000000"})
    alone, outcome = solve(team, options), solve(replace(team, scenario=(event,)), options)
    assert (alone.verdict, alone.deadline) == (Verdict.SOLUTION, 100)
    assert [epoch.verdict for epoch in outcome.epochs] == [Verdict.SOLUTION, Verdict.SOLUTION]
    assert (outcome.verdict, outcome.deadline, outcome.reason) == (Verdict.SOLUTION, 100, None)
    assert (outcome.assignment, outcome.cost) == (outcome.epochs[1].assignment, outcome.epochs[1].cost)
    assert outcome.assignment[team.robots[0].variables[0].name] != 2


@pytest.mark.usefixtures("a_second_a_look")
def test_an_answer_to_a_problem_that_was_to_change_is_none() -> None:
    """Where all messages have been sent before the last event, its epoch has the answer, the run does not."""
    team = random_csp(6, 3, 0.6, 0.0, seed=1, max_cost=9)
    event = ScenarioEvent((RemoveValue(team.robots[0].variables[0].name, 2),))
    options = Options(
        protocol="dsa", runtime=Runtime.SIMULATOR, deadline=100, settings={"cycles": "1000000"}, messages=100_000
    )
    for messages in (20, 60):
        outcome = solve(replace(team, scenario=(event,)), replace(options, messages=messages))
        assert len(outcome.epochs) == 1 or outcome.events == 1
        assert (outcome.verdict, outcome.deadline) == (Verdict.UNKNOWN, None)


@pytest.mark.usefixtures("a_second_a_look")
def test_robots_that_withdraw_by_then_leave_an_answer_for_the_others() -> None:
    """Nobody has proven that the whole team has no solution, nor that no fewer could withdraw: that is said."""
    team = queens3d(3)
    options = Options(protocol="bnb-adopt", runtime=Runtime.SIMULATOR, deadline=200, withdraw=Withdrawal.MINIMUM)
    outcome = solve(team, options)
    assert (outcome.verdict, outcome.deadline) == (Verdict.SOLUTION, 200)
    assert outcome.withdrawn
    assert list(violations(team, outcome.assignment, outcome.withdrawn)) == []
    report = outcome_report(team, outcome)
    assert "by the deadline of 200 s, not proven to be the minimum" in report
    assert "no solution" not in report


def test_before_all_events_a_limit_on_messages_decides_nothing_either() -> None:
    team = random_csp(6, 3, 0.6, 0.1, seed=1)
    event = ScenarioEvent((RemoveValue(team.robots[0].variables[0].name, 2),))
    options = Options(protocol="maxsum", runtime=Runtime.SIMULATOR, messages=600)
    outcome = solve(replace(team, scenario=(event,)), options)
    assert [epoch.verdict for epoch in outcome.epochs] == [Verdict.SOLUTION]
    assert (outcome.verdict, outcome.deadline) == (Verdict.UNKNOWN, None)
    assert outcome.reason == "the limit of messages was reached (--messages 600), and 1 event had not happened"


def test_who_is_done_before_has_the_same_answer_as_without_a_deadline() -> None:
    for seed in range(20):
        team = random_cost_team(Random(seed))
        options = Options(protocol="dpop", runtime=Runtime.SIMULATOR)
        before, by = solve(team, options), solve(team, replace(options, deadline=3600))
        assert (before.verdict, before.assignment, before.cost) == (by.verdict, by.assignment, by.cost)
        assert by.deadline is None


def test_a_limit_on_messages_is_none_on_time() -> None:
    options = Options(protocol="syncbb", runtime=Runtime.SIMULATOR, deadline=3600, messages=3000)
    outcome = solve(hard_to_prove(), options)
    assert (outcome.verdict, outcome.deadline) == (Verdict.UNKNOWN, None)
    assert outcome.reason == "the limit of messages was reached (--messages 3000)"


def test_it_is_given_instead_of_a_timeout_and_to_robots() -> None:
    for options in (Options(deadline=1, timeout=2), Options(deadline=1, protocol="central")):
        with pytest.raises(UnsupportedError, match="--deadline"):
            solve(queens3d(2), options)


@count("runs", 100, 2000)
def test_whatever_robots_have_at_that_moment_only_what_breaks_nothing_is_an_answer(runs: int) -> None:
    """Robots with any values, of protocols with and without costs: brute force says what may be answered."""
    names = [name for name in protocol_names() if protocol_named(name).__module__.startswith("robochoc.")]
    answered = 0
    for number in range(runs):
        chance = Random(number)
        name = names[number % len(names)]
        with_costs = protocol_named(name).traits.costs
        team = (random_cost_team if with_costs else random_team)(chance)
        compiled = ensure_compiled(team)
        values = {
            robot: compiled[robot].solution(chance.randrange(len(compiled[robot].values)))
            for robot in team.order
            if compiled[robot].values and chance.random() < 0.97
        }
        missing: dict[str, dict[str, int]] = {robot: {} for robot in team.order if robot not in values}
        result = SearchResult.of(Verdict.UNKNOWN, None, {**values, **missing}, (), 0)
        result = replace(result, findings={robot: Findings() for robot in team.order})
        phase = first_phase(Options(protocol=name), protocol_named(name), lambda: 1)
        search = Search(result, partial(check_with_files, phase, result, team, compiled))
        answer = evaluate_search(phase, search, team.kind, int, deadline=1.0)
        merged = {variable: value for own in values.values() for variable, value in own.items()}
        prices = {tuple(sorted(one.items())): price for one, price in priced_solutions(team)}
        price = prices.get(tuple(sorted(merged.items())), INFINITE)
        if price < INFINITE and len(merged) == len(team.variables):
            answered += 1
            assert (answer.verdict, answer.cost, answer.deadline) == (Verdict.SOLUTION, price, 1.0)
            assert least_cost(team) <= price
        else:
            assert (answer.verdict, answer.assignment, answer.deadline) == (Verdict.UNKNOWN, {}, None)
    assert answered > runs / 20
