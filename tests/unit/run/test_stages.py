"""Runs with a deadline in which several protocols search in turn."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from robochoc.formats.result import read_result, result_json
from robochoc.generators.coloring import coloring
from robochoc.generators.families import FAMILIES
from robochoc.journal.events import AnyEvent, Began, Decided
from robochoc.journal.journal import read_journal
from robochoc.journal.recorder import JournalRecorder
from robochoc.model.costs import normalized
from robochoc.model.outcome import Outcome, SearchStage, Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.replay import replay
from robochoc.run import Options, Runtime, solve
from robochoc.run.choice import choose
from robochoc.run.choice_stages import LOCAL_SEARCHES, LOCAL_SEARCHES_IF_LARGE
from robochoc.run.options import AnswerRule, Stage, Withdrawal
from robochoc.run.recording import journal_header, objective_to_record
from robochoc.verification.checker import assignment_cost
from tests.support.announcements import check_announcements
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team

DSA_FIRST = (Stage("dsa", 0.005, {"cycles": "5"}, 0.7), Stage("sfb", 1.0))
"""DSA searches for a two-hundredth of the time."""
IN_TURN = Options(protocol="sfb", runtime=Runtime.SIMULATOR, deadline=20.0, stages=DSA_FIRST, cache=False)


def coloured(agents: int = 40) -> Team:
    return coloring(agents=agents, colors=3, degree=5.0, conflicts="weighted", seed=3)


@pytest.mark.parametrize("start", range(0, 40, 10))
def test_the_complete_search_proves_what_the_local_search_has_found_or_finds_better(start: int) -> None:
    for seed in range(start, start + 10):
        team = random_cost_team(Random(seed), n_ary=False)
        outcome = solve(team, replace(IN_TURN, seed=seed))
        least = least_cost(team)
        if least == INFINITE:
            assert outcome.verdict is Verdict.NO_SOLUTION
            continue
        assert (outcome.verdict, outcome.deadline) == (Verdict.OPTIMAL, None)
        assert outcome.cost == least
        assert [stage.protocol for stage in outcome.stages] in (["dsa", "sfb"], ["dsa"])
        assert sum(outcome.metrics.messages.values()) > 0 or len(team.order) < 2


def test_a_stage_restarts_from_the_best_assignment_until_its_time_is_over() -> None:
    events: list[AnyEvent] = []
    team = coloured(12)
    stages = (Stage("dsa", 1.0, {"cycles": "3"}, 0.8),)
    outcome = solve(team, replace(IN_TURN, protocol="dsa", stages=stages, deadline=8.0), observer=events.append)
    began = [event for event in events if isinstance(event, Began)]
    (stage,) = outcome.stages
    assert (stage.protocol, stage.searches, stage.cost) == ("dsa", len(began), outcome.cost)
    assert [event.continues is True for event in began] == [False, *[True] * (len(began) - 1)]
    assert stage.searches >= 2
    assert outcome.cost == assignment_cost(normalized(team), outcome.assignment)
    started = [len(event.start) for event in began if isinstance(event.start, dict)]
    assert all(0 < count <= len(team.order) for count in started)
    assert len(started) < 10 or sum(started) / len(started) / len(team.order) == pytest.approx(0.8, abs=0.2)


def test_the_answer_is_never_worse_than_that_of_any_stage() -> None:
    stages = (Stage("maxsum", 0.3, {"cycles": "50"}), *(Stage("dsa", 0.6, {"cycles": "5"}, 0.9), Stage("mgm2", 1.0)))
    outcome = solve(coloured(20), replace(IN_TURN, protocol="mgm2", stages=stages, deadline=2.0))
    costs = [stage.cost for stage in outcome.stages if stage.cost is not None]
    assert costs == sorted(costs, reverse=True)
    assert outcome.cost == costs[-1]
    assert outcome.verdict is Verdict.SOLUTION


def test_whatever_is_announced_in_a_stage_is_kept() -> None:
    for seed in range(3):
        team = random_cost_team(Random(seed), n_ary=False)
        check_announcements(team, replace(IN_TURN, seed=seed))
        dsa = (Stage("dsa", 0.5, {"cycles": "3"}, 0.5), Stage("mgm", 1.0, {"cycles": "3"}, 0.5))
        check_announcements(team, replace(IN_TURN, seed=seed, deadline=0.3, protocol="mgm", stages=dsa))


def test_arrays_and_objects_search_alike_from_a_start() -> None:
    """The first restart begins from the same values with the same random numbers."""
    team, settings = coloured(), {"cycles": "60"}
    first = solve(team, Options(protocol="dsa", runtime=Runtime.SIMULATOR, settings=settings, cache=False))
    options = Options(protocol="dsa", settings=settings, seed=7, start=first.assignment, cache=False)
    arrays = solve(team, replace(options, runtime=Runtime.ARRAYS))
    events: list[AnyEvent] = []
    objects = solve(team, replace(options, runtime=Runtime.SIMULATOR), observer=events.append)
    assert arrays.cost is not None
    assert objects.cost is not None
    assert objects.cost <= arrays.cost <= (first.cost or 0)
    assert objects.metrics.messages == arrays.metrics.messages
    assert any(isinstance(event, Decided) for event in events)


def test_a_maximised_problem_and_robots_that_may_withdraw() -> None:
    utilities = FAMILIES["random"](agents=8, domain=3, density=0.5, max_cost=9, maximize=True, seed=1)
    alone = solve(utilities, Options(protocol="sfb", runtime=Runtime.SIMULATOR))
    assert solve(utilities, IN_TURN).cost == alone.cost
    for seed in range(6):
        team = random_cost_team(Random(seed), n_ary=False)
        options = replace(IN_TURN, withdraw=Withdrawal.MINIMUM, seed=seed)
        found, alone = solve(team, options), solve(team, replace(options, stages=(), deadline=None))
        assert (found.verdict, found.cost, len(found.withdrawn)) == (alone.verdict, alone.cost, len(alone.withdrawn))


def test_processes_search_in_turn() -> None:
    team = random_cost_team(Random(4), n_ary=False)
    stages = (Stage("dsa", 0.05, {"cycles": "3"}, 0.7), Stage("sfb", 1.0))
    outcome = solve(team, replace(IN_TURN, runtime=Runtime.PROCESSES, deadline=40.0, stages=stages))
    assert outcome.verdict is Verdict.OPTIMAL
    assert outcome.cost == least_cost(team)
    assert outcome.stages[0].searches > 1


def test_a_journal_of_stages_is_replayed() -> None:
    team = coloured()
    stages = (Stage("dsa", 0.5, {"cycles": "5"}, 0.9), Stage("mgm2", 1.0, {"cycles": "5"}, 0.9))
    options = replace(IN_TURN, protocol="mgm2", stages=stages, deadline=4.0)
    recorder = JournalRecorder(journal_header(team, options), objective_to_record(team, options))
    recorder.outcome = solve(team, options, observer=recorder)
    journal = read_journal(recorder.content())
    assert replay(journal).identical
    began = [event for event in journal.events if isinstance(event, Began)]
    assert len(began) == sum(stage.searches for stage in recorder.outcome.stages)


# The choice


def test_settings_of_the_user_are_not_overridden_by_stages() -> None:
    options = Options(runtime=Runtime.SIMULATOR, deadline=5.0, settings={"cycles": "5"})
    chosen = choose(coloured(), options).options
    assert (chosen.stages, chosen.settings) == ((), {"cycles": "5"})


def test_auto_chooses_stages_only_for_a_deadline_and_costs() -> None:
    team = coloured()
    options = Options(runtime=Runtime.SIMULATOR, deadline=1.0)
    chosen = choose(team, options).options
    names = [stage.protocol for stage in chosen.stages]
    assert names == [chosen.protocol, "maxsum", "maxsum-ad", "dsa", "mgm2", chosen.protocol]
    assert [stage.until for stage in chosen.stages] == sorted(stage.until for stage in chosen.stages)
    assert chosen.stages[-1].until == 1.0
    assert "stages" in chosen.chosen
    for other in (
        replace(options, deadline=None),
        replace(options, protocol="dsa"),
        replace(options, messages=100),
        replace(options, answer=AnswerRule.FINAL),
        replace(options, message_loss=0.1),
    ):
        assert choose(team, other).options.stages == ()


def test_the_local_searches_suit_the_team() -> None:
    kinds = {
        "crowd": FAMILIES["tasks"](agents=14, tasks=12, seed=1),
        "equal": coloring(agents=40, colors=3, degree=5.0, conflicts="soft", seed=3),
        "other": coloured(),
    }
    for kind, team in kinds.items():
        stages = choose(team, Options(runtime=Runtime.SIMULATOR, deadline=5.0)).options.stages
        found = {(stage.protocol, stage.until) for stage in stages}
        assert {*LOCAL_SEARCHES[kind]} <= found, kind
        large = choose(team, Options(runtime=Runtime.SIMULATOR, deadline=0.01)).options
        assert [(stage.protocol, stage.until) for stage in large.stages] == [*LOCAL_SEARCHES_IF_LARGE[kind]]
        assert large.protocol == large.stages[-1].protocol
    processes = Options(deadline=1.0)
    assert [stage.protocol for stage in choose(coloured(), processes).options.stages] == ["dsa"]
    few = choose(coloured(6), replace(processes, deadline=30.0)).options
    assert [stage.protocol for stage in few.stages] == [few.protocol, "dsa", few.protocol]


def test_a_problem_that_is_solved_in_a_moment_has_one_stage() -> None:
    team = random_cost_team(Random(5), n_ary=False)
    outcome = solve(team, Options(runtime=Runtime.SIMULATOR, deadline=5.0))
    assert outcome.verdict is Verdict.OPTIMAL
    assert len(outcome.stages) == 1


# The result


def test_stages_are_in_the_json_result() -> None:
    stages = (SearchStage("sfb", 0.1, 1, None), SearchStage("dsa", 0.25, 12, 7))
    outcome = Outcome(Verdict.SOLUTION, team="t", protocol="sfb", runtime="simulator", seed=0, cost=7, stages=stages)
    assert read_result(result_json(outcome)).stages == stages
    assert outcome.same_answer(replace(outcome, stages=tuple(one._replace(seconds=1.0) for one in stages)))
