"""Problems that change over time: each epoch's verdict against brute force, by every protocol and runtime."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from random import Random

import pytest

from robochoc.journal.journal import Header, JournalRecorder, metrics_of, read_journal
from robochoc.model.orders import Order
from robochoc.model.outcome import Metrics, Outcome, Verdict
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Constraint,
    Domain,
    Parent,
    Relation,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Semantics,
    Variable,
)
from robochoc.run import Options, Runtime, solve
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.cases import cases, looped
from tests.support.examples import count, drawn
from tests.support.limits import HANG_S
from tests.support.loose_problems import loosened
from tests.support.problems import ON_ONE_MACHINE, random_team, team_of
from tests.support.random_changes import check_epochs, random_changing_team
from tests.support.random_options import random_schedule
from tests.support.small_teams import differ, pair

pytestmark = [pytest.mark.fresh, pytest.mark.usefixtures("quick_encryption")]
COMPLETE = [
    name
    for name in protocol_names()
    if (traits := protocol_named(name).traits).n_ary and traits.complete and name != "dynabt"
]

SIMULATED = Options(runtime=Runtime.SIMULATOR, protocol="dynabt")


def random_dynabt(chance: Random) -> Options:
    return replace(random_schedule(chance), protocol="dynabt")


@count("problems", 30, 900)
def test_dynabt_agrees_with_brute_force_after_each_change(problems: int) -> None:
    ended = 0
    with cases() as each:
        for number in range(problems):
            with each(number):
                chance = drawn(f"dynabt {number}")
                ended += check_epochs(random_changing_team(chance), random_dynabt(chance))
    assert ended > 7 * problems


@count("problems", 3, 16)
@looped("protocol", COMPLETE)
def test_any_protocol_begins_anew_after_each_change(protocol: str, problems: int) -> None:
    for number in range(problems):
        chance = drawn(f"anew {protocol} {number}")
        team = random_changing_team(chance, 6)
        check_epochs(team, replace(random_schedule(chance), protocol=protocol))


@count("problems", 1, 12)
@pytest.mark.parametrize("protocol", ["dynabt", "abt"])
def test_processes_go_through_epochs_as_well(protocol: str, problems: int) -> None:
    for number in range(problems):
        team = random_changing_team(drawn(f"processes {protocol} {number}"), 6)
        check_epochs(team, Options(protocol=protocol, timeout=HANG_S))


def test_epochs_follow_an_order_that_is_asked_for() -> None:
    for number in range(20):
        chance = drawn(f"order {number}")
        team = random_changing_team(chance, 5, partial(loosened, chance=chance))
        order = chance.choice([*Order, tuple(chance.sample(team.order, len(team.order)))])
        check_epochs(team, replace(random_dynabt(chance), order=order))


def test_the_judge_goes_through_the_same_epochs() -> None:
    team = pair(ScenarioEvent((AddValue("B", 2),)), ScenarioEvent((RemoveValue("B", 2),)))
    outcome = solve(team, Options(protocol="central", cache=False))
    assert [epoch.verdict for epoch in outcome.epochs] == ["no-solution", "solution", "no-solution"]


def test_second_opinions_are_asked_for_in_each_epoch() -> None:
    team = pair(ScenarioEvent((AddValue("B", 2),)), ScenarioEvent((RemoveValue("B", 2),)))
    outcome = solve(team, replace(SIMULATED, verify=True, cache=False))
    assert [epoch.verified for epoch in outcome.epochs] == [True, True, True]


# What each change does


def verdicts(outcome: Outcome) -> list[str]:
    return [str(epoch.verdict) for epoch in outcome.epochs]


def test_a_constraint_goes_and_another_comes() -> None:
    team = pair(
        ScenarioEvent((RemoveConstraint("RB", "RA", "C"),)),
        ScenarioEvent((AddConstraint("RB", "RA", differ("A", "B", "again")),)),
    )
    assert verdicts(solve(team, SIMULATED)) == ["no-solution", "solution", "no-solution"]


def test_a_robot_leaves_and_another_joins() -> None:
    newcomer = Robot(
        "RC",
        (Variable("C", Domain("D", (range(1, 2),))),),
        parents=(Parent("RB", (differ("B", "C"),)),),
    )
    team = pair(ScenarioEvent((RemoveAgent("RA"),)), ScenarioEvent((AddAgent(newcomer),)))
    outcome = solve(team, SIMULATED)
    assert verdicts(outcome) == ["no-solution", "solution", "no-solution"]
    assert [epoch.robots for epoch in outcome.epochs] == [("RA", "RB"), ("RB",), ("RB", "RC")]


def test_a_verdict_that_still_stands_costs_nothing() -> None:
    team = pair(ScenarioEvent((AddConstraint("RB", "RA", differ("A", "B", "more")),)))
    first, second = solve(team, SIMULATED).epochs
    assert first.verdict is second.verdict is Verdict.NO_SOLUTION
    assert second.metrics.messages == {}
    assert second.witness == first.witness
    anew = solve(team, replace(SIMULATED, protocol="abt")).epochs[1]
    assert sum(anew.metrics.messages.values()) > 0


def test_a_change_that_hurts_nobody_costs_nothing() -> None:
    team = pair(ScenarioEvent((AddValue("A", 3),)), values=2)
    second = solve(team, SIMULATED).epochs[1]
    assert second.verdict is Verdict.SOLUTION
    assert second.metrics.messages == {}


def test_an_event_in_mid_run_ends_the_epoch_without_a_verdict() -> None:
    """Nine robots would search for seconds: the event comes in mid-run on a busy machine as well."""
    different = Relation("different", 2, Semantics.CONFLICTS, tuple((value, value) for value in range(1, 8)))
    constraints = [Constraint("C", different, pair, pair) for pair in itertools.combinations("ABCDEFGHI", 2)]
    leave = tuple(RemoveAgent(f"R{name}") for name in "CDEFGHI")
    team = team_of(dict.fromkeys("ABCDEFGHI", range(1, 8)), constraints)
    team = replace(team, scenario=(ScenarioEvent(leave, after=8),))
    for runtime in ON_ONE_MACHINE:
        first, second = solve(team, replace(SIMULATED, runtime=runtime, timeout=HANG_S)).epochs
        assert first.verdict is Verdict.UNKNOWN
        assert sum(first.metrics.messages.values()) >= 8
        assert second.verdict is Verdict.SOLUTION


def test_an_event_in_mid_run_comes_at_the_end_if_there_are_not_so_many_messages() -> None:
    team = pair(ScenarioEvent((RemoveAgent("RA"),), after=1000), values=2)
    assert verdicts(solve(team, SIMULATED)) == ["solution", "solution"]


def test_the_outcome_sums_up_its_epochs() -> None:
    for number in range(10):
        chance = drawn(f"sum {number}")
        outcome = solve(random_changing_team(chance), replace(SIMULATED, seed=chance.getrandbits(30)))
        last = outcome.epochs[-1]
        assert (outcome.verdict, outcome.assignment) == (last.verdict, last.assignment)
        assert outcome.metrics.messages == sum((e.metrics for e in outcome.epochs), Metrics()).messages
        assert outcome.metrics.ncccs == sum(e.metrics.ncccs for e in outcome.epochs)


def test_a_problem_that_does_not_change_has_no_epochs() -> None:
    assert solve(random_team(Random(1)), SIMULATED).epochs == ()


@pytest.mark.parametrize("runtime", ON_ONE_MACHINE)
def test_the_journal_says_what_the_metrics_say(runtime: Runtime) -> None:
    team = random_changing_team(Random(5), 6)
    recorder = JournalRecorder(Header(team=team.name, protocol="dynabt", runtime=runtime, seed=0))
    outcome = solve(team, replace(SIMULATED, runtime=runtime), observer=recorder)
    told = metrics_of(read_journal(recorder.content()).events)
    assert (told.messages, told.bytes, told.ncccs) == (
        {kind: n for kind, n in outcome.metrics.messages.items() if n},
        outcome.metrics.bytes,
        outcome.metrics.ncccs,
    )
