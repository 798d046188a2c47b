"""What a journal claims beside its steps: a header, or an outcome, that does not follow from them is found."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from random import Random
from typing import Any

import msgspec
import pytest

from robochoc.formats import read_team
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.journal.events import Began, Decided, Given, Sent
from robochoc.journal.journal import Journal
from robochoc.model.assembly import Extras, assemble
from robochoc.model.costs import user_cost
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import INFINITE, Constraint, Domain, ProblemKind, Relation, Semantics, Team, Variable
from robochoc.replay import replay
from robochoc.run.options import AnswerRule, Options, Runtime, Withdrawal
from robochoc.verification.checker import assignment_cost, violations
from tests.support.compiled import plain_python_only
from tests.support.complex_problems import random_complex_team
from tests.support.counted_clock import time_passes_at_each_look
from tests.support.program import ROOT
from tests.support.random_changes import random_changing_team
from tests.support.replays import identical, recorded

COSTS = (INFINITE, 8)
ALL_FLY = Options(protocol="abt", runtime=Runtime.SIMULATOR)


@pytest.fixture(scope="module")
def three() -> Journal:
    """Three queens' robots search, and as few as possible withdraw: two runs."""
    journal = recorded(queens3d(3), replace(ALL_FLY, withdraw=Withdrawal.MINIMUM))
    assert replay(journal).identical
    return journal


def test_a_header_that_is_another_runs_is_found(three: Journal) -> None:
    for field, value in (("protocol", "afc"), ("seed", 7), ("order", ("Robot1.2", "Robot1.1"))):
        changes: dict[str, Any] = {field: value}
        header = msgspec.structs.replace(three.header, **changes)
        assert three.outcome is not None
        own = replace(three.outcome, **changes) if field != "order" else three.outcome
        found = replay(replace(three, header=header, outcome=own))
        assert [one.what for one in found.contradictions] == [f"the header's {field}"]
        assert not found.identical
    for field, value in (("team", "five"), ("runtime", "processes")):
        found = replay(replace(three, header=msgspec.structs.replace(three.header, **{field: value})))
        assert [one.what for one in found.contradictions] == [f"the outcome's {field}"]


def test_an_outcome_that_does_not_follow_is_found(three: Journal) -> None:
    outcome = three.outcome
    assert outcome is not None
    metrics = outcome.metrics
    other = dict(outcome.assignment)
    other.popitem()
    for field, claimed in (
        ("verdict", replace(outcome, verdict=Verdict.SOLUTION)),
        ("verdict", replace(outcome, verdict=Verdict.NO_SOLUTION)),
        ("assignment", replace(outcome, assignment=other)),
        ("cost", replace(outcome, cost=17)),
        ("withdrawn", replace(outcome, withdrawn=outcome.withdrawn[1:])),
        ("messages", replace(outcome, metrics=replace(metrics, messages={"Ok": 1}))),
        ("bytes", replace(outcome, metrics=replace(metrics, bytes=metrics.bytes + 1))),
        ("ncccs", replace(outcome, metrics=replace(metrics, ncccs=metrics.ncccs - 1))),
        ("checks", replace(outcome, metrics=replace(metrics, checks=0))),
        ("largest", replace(outcome, metrics=replace(metrics, largest=metrics.largest + 1))),
    ):
        found = replay(replace(three, outcome=claimed))
        assert found.difference is None
        assert [one.what for one in found.contradictions] == [f"the outcome's {field}"]
        assert not found.identical


def test_a_robot_that_an_epoch_withdraws_falsely_is_found() -> None:
    rescue = recorded(read_team(ROOT / "docs" / "examples" / "rescue"), ALL_FLY)
    outcome = rescue.outcome
    assert outcome is not None
    assert replay(rescue).identical
    first, *others = outcome.epochs
    claimed = replace(outcome, epochs=(replace(first, withdrawn=("East",)), *others))
    (found,) = replay(replace(rescue, outcome=claimed)).contradictions
    assert (found.what, found.recorded, found.replayed) == ("epoch 0's withdrawn", ["East"], [])


def test_a_solution_is_not_a_proof_that_there_is_none() -> None:
    solvable = recorded(read_team(ROOT / "docs" / "examples" / "scouts"), ALL_FLY)
    assert replay(solvable).identical
    assert solvable.outcome is not None
    assert solvable.outcome.verdict == "solution"
    claimed = replace(solvable.outcome, verdict=Verdict.NO_SOLUTION, assignment={}, cost=None)
    found = replay(replace(solvable, outcome=claimed))
    assert {one.what for one in found.contradictions} == {
        "the outcome's verdict",
        "the outcome's assignment",
        "the outcome's cost",
    }


def test_the_best_assignment_on_the_way_is_an_answer() -> None:
    """A mixture of values that the robots never had together is found, although its cost is right."""
    on_the_way = 0
    for seed in range(12):
        team = random_csp(5, 4, 0.8, 0, seed, max_cost=50)
        journal = recorded(team, replace(ALL_FLY, protocol="dsa", settings={"cycles": "8"}, seed=seed))
        assert replay(journal).identical, seed
        values: dict[str, int] = {}
        had = []
        for event in journal.events:
            if isinstance(event, Decided):
                values |= event.assignment
                had.append(dict(values))
        outcome = journal.outcome
        assert outcome is not None
        assert outcome.assignment in had
        unsolvable = replay(replace(journal, outcome=replace(outcome, verdict=Verdict.NO_SOLUTION)))
        assert "the outcome's verdict" in {one.what for one in unsolvable.contradictions}, seed
        on_the_way += outcome.cost != user_cost(team, assignment_cost(team, values))
        for name, value in outcome.assignment.items():
            mixed = {**outcome.assignment, name: value % 4 + 1}
            if mixed not in had:
                claimed = replace(outcome, assignment=mixed, cost=user_cost(team, assignment_cost(team, mixed)))
                assert replay(replace(journal, outcome=claimed)).contradictions, (seed, name)
    assert on_the_way > 0


BY_A_DEADLINE = Options(
    protocol="dsa", runtime=Runtime.SIMULATOR, settings={"cycles": "100000"}, seed=1, deadline=40, improve=400
)


def ended_by_the_time(options: Options) -> Journal:
    """Return the journal of a search for the least cost that the time has ended."""
    with time_passes_at_each_look():
        journal = recorded(random_csp(6, 4, 0.8, 0, 1, max_cost=50), options)
    assert journal.outcome is not None
    assert (journal.outcome.verdict, journal.outcome.deadline) == ("solution", 40)
    return journal


@plain_python_only
def test_an_answer_by_a_deadline_is_what_the_robots_had_then() -> None:
    journal = ended_by_the_time(replace(BY_A_DEADLINE, improve=None))
    assert journal.outcome is not None
    assert replay(journal).identical
    for field, claimed in (
        ("verdict", replace(journal.outcome, verdict=Verdict.OPTIMAL)),
        ("cost", replace(journal.outcome, cost=1)),
    ):
        found = replay(replace(journal, outcome=claimed))
        assert [one.what for one in found.contradictions] == [f"the outcome's {field}"]


@plain_python_only
def test_an_answer_that_was_improved_is_as_good_as_what_the_robots_end_with() -> None:
    journal = ended_by_the_time(BY_A_DEADLINE)
    outcome = journal.outcome
    assert outcome is not None
    assert len(outcome.improvements) > 1
    assert replay(journal).identical
    worse = {name: value % 4 + 1 for name, value in outcome.assignment.items()}
    beyond = dict.fromkeys(outcome.assignment, 17)
    for field, claimed in (
        ("assignment", replace(outcome, assignment=beyond)),
        ("cost", replace(outcome, assignment=worse)),
        ("cost", replace(outcome, cost=1)),
        ("verdict", replace(outcome, verdict=Verdict.OPTIMAL)),
    ):
        found = replay(replace(journal, outcome=claimed))
        assert {one.what for one in found.contradictions} == {f"the outcome's {field}"}
    unsolvable = replace(outcome, verdict=Verdict.NO_SOLUTION)
    for claimed in (unsolvable, replace(unsolvable, improvements=())):
        found = replay(replace(journal, outcome=claimed))
        assert "the outcome's verdict" in {one.what for one in found.contradictions}


@plain_python_only
def test_processes_that_a_deadline_ends_may_have_told_less_than_they_did_and_not_more() -> None:
    journal = ended_by_the_time(replace(BY_A_DEADLINE, improve=None))
    assert journal.outcome is not None
    outcome = replace(journal.outcome, runtime="processes")
    metrics = outcome.metrics
    header = msgspec.structs.replace(journal.header, runtime="processes")
    for messages, told in ((-1, []), (1, ["the outcome's messages"])):
        more = {kind: number + messages for kind, number in metrics.messages.items()}
        claimed = replace(outcome, metrics=replace(metrics, messages=more))
        found = replay(replace(journal, header=header, outcome=claimed))
        assert [one.what for one in found.contradictions] == told


def test_final_answers_are_not_compared_with_the_best_ones() -> None:
    """Found by `make simulate`."""
    compared = 0
    for seed in range(20):
        team = random_csp(5, 3, 0.7, 0.1, seed=seed, max_cost=9)
        options = Options(protocol="regret-matching", runtime=Runtime.SIMULATOR, settings={"cycles": "3"}, seed=seed)
        final, best = (recorded(team, replace(options, answer=rule)) for rule in (AnswerRule.FINAL, AnswerRule.BEST))
        assert (final.header.answer, best.header.answer) == ("final", msgspec.UNSET)
        for journal in (final, best):
            assert identical(replay(journal)), (seed, replay(journal))
        assert final.outcome is not None
        assert best.outcome is not None
        compared += final.outcome.cost != best.outcome.cost
    assert compared > 3


def test_the_best_assignment_of_an_asynchronous_search_is_no_contradiction() -> None:
    """Found by `make simulate`: the last values violate a constraint, earlier ones did not."""
    options = Options(protocol="async-maxsum", runtime=Runtime.SIMULATOR, cache=False)
    earlier = 0
    for number in range(25):
        team = random_csp(5, 3, 0.7, 0.25, seed=number, max_cost=9)
        journal = recorded(team, replace(options, repair=False))
        found = replay(journal)
        assert identical(found), (number, found)
        outcome = journal.outcome
        assert outcome is not None
        last = {event.robot: event.assignment for event in journal.events if isinstance(event, Decided)}
        if outcome.assignment and outcome.assignment != {k: v for one in last.values() for k, v in one.items()}:
            earlier += 1
            forged = replace(journal, outcome=replace(outcome, cost=(outcome.cost or 0) - 1))
            assert [one.what for one in replay(forged).contradictions] == ["the outcome's cost"]
    assert earlier


def test_the_bound_of_the_search_before_a_repair_may_prove_the_answer() -> None:
    """Found by `make simulate`: the replay compared the answer with the repair alone, which has no bound."""
    options = Options(protocol="bounded-maxsum", runtime=Runtime.SIMULATOR, cache=False)
    verdicts = set()
    for number in (2, 42, 44):
        journal = recorded(random_csp(6, 3, 0.6, 0.4, seed=number, max_cost=9), options)
        outcome = journal.outcome
        assert outcome is not None
        assert identical(replay(journal)), number
        if outcome.repair:
            verdicts.add(outcome.verdict)
        if outcome.repair and outcome.verdict == Verdict.SOLUTION:
            forged = replace(journal, outcome=replace(outcome, verdict=Verdict.OPTIMAL))
            assert "the outcome's verdict" in [one.what for one in replay(forged).contradictions]
    assert verdicts >= {Verdict.SOLUTION, Verdict.OPTIMAL}


def test_decisions_of_processes_are_known_in_bundles_only() -> None:
    """Found by `make simulate`: the answer was an assignment that the robots had, in the order of their reports."""
    found = 0
    for seed in range(16):
        team = random_csp(4, 3, 0.7, 0.1, seed=seed, max_cost=9)
        settings = {"cycles": "5"}
        options = Options(protocol="dsa", runtime=Runtime.SIMULATOR, settings=settings, seed=seed, repair=False)
        journal = recorded(team, options)
        outcome = journal.outcome
        assert outcome is not None
        cheaper = next(cheaper_combinations(team, journal), None)
        if cheaper is None:
            continue
        found += 1
        cost = user_cost(team, assignment_cost(team, cheaper))
        assert cost is not None
        in_thread = replace(journal, outcome=replace(outcome, assignment=cheaper, cost=cost))
        assert [one.what for one in replay(in_thread).contradictions] == [
            "the outcome's assignment",
            "the outcome's cost",
        ]
        header = msgspec.structs.replace(journal.header, runtime=Runtime.PROCESSES)
        ours = replace(in_thread.outcome or outcome, runtime=Runtime.PROCESSES)
        assert identical(replay(replace(journal, header=header, outcome=ours)))
        false = replace(journal, header=header, outcome=replace(ours, cost=cost - 1))
        assert [one.what for one in replay(false).contradictions] == ["the outcome's cost"]
    assert found


def test_a_search_without_time_ends_with_its_start() -> None:
    """Found by `make simulate`: the replay of a search in which no robot began had no solution."""
    team = random_csp(4, 3, 0.5, 0.2, seed=1)
    options = Options(protocol="abt", runtime=Runtime.SIMULATOR, cache=False)
    solved = recorded(team, options).outcome
    assert solved is not None
    assert solved.verdict is Verdict.SOLUTION
    journal = recorded(team, replace(options, start=solved.assignment, deadline=1000))
    outcome = journal.outcome
    assert outcome is not None
    nothing = tuple(event for event in journal.events if isinstance(event, Began | Given))
    late = replace(outcome, assignment=solved.assignment, metrics=Metrics(), deadline=1000)
    found = replay(replace(journal, events=nothing, outcome=late))
    assert not found.contradictions
    other = {name: value % 3 + 1 for name, value in solved.assignment.items()}
    assert replay(replace(journal, events=nothing, outcome=replace(late, assignment=other))).contradictions


def test_a_search_that_is_stopped_at_its_end_may_return_its_start() -> None:
    """Found by `make simulate`: at a deadline, robots had another solution, which is not better than the start."""
    chance, found = Random(1), 0
    options = Options(protocol="afc-ng", runtime=Runtime.SIMULATOR, cache=False, deadline=1000)
    for _ in range(10):
        team = random_complex_team(chance)
        every = itertools.product(*(tuple(one.domain) for one in team.variables.values()))
        solutions = [dict(zip(team.variables, values, strict=True)) for values in itertools.islice(every, 5000)]
        solutions = [solution for solution in solutions if not [*violations(team, solution)]][-3:]
        for start in solutions:
            journal = recorded(team, replace(options, start=start))
            assert journal.outcome is not None
            if journal.outcome.assignment == start:
                continue
            found += 1
            early = replace(journal.outcome, assignment=start)
            assert replay(replace(journal, outcome=early)).contradictions
            header = msgspec.structs.replace(journal.header, runtime=Runtime.PROCESSES)
            for claimed in (start, *solutions):
                ours = replace(early, runtime=Runtime.PROCESSES, assignment=claimed)
                is_right = claimed in (start, journal.outcome.assignment)
                assert (not replay(replace(journal, header=header, outcome=ours)).contradictions) == is_right
    assert found


def cheaper_combinations(team: Team, journal: Journal) -> Iterator[dict[str, int]]:
    """Yield valid combinations of the robots' values that cost less than the answer."""
    decided: dict[str, list[dict[str, int]]] = {name: [] for name in team.order}
    for event in journal.events:
        if isinstance(event, Decided) and event.assignment not in decided[event.robot]:
            decided[event.robot].append(event.assignment)
    assert journal.outcome is not None
    for parts in itertools.product(*decided.values()):
        values = {name: value for part in parts for name, value in part.items()}
        if not [*violations(team, values)] and (assignment_cost(team, values) or 0) < (journal.outcome.cost or 0):
            yield values


@plain_python_only
def test_answers_of_snapshots_before_the_deadline_are_no_contradictions() -> None:
    """Found by `make simulate`: with `--improve`, an answer may be that of a snapshot, before the last values."""
    options = Options(protocol="aas", runtime=Runtime.SIMULATOR, deadline=40, improve=40, cache=False)
    others = 0
    for seed in range(16):
        with time_passes_at_each_look():
            journal = recorded(random_csp(5, 3, 0.5, 0.2, seed=seed), options)
        assert journal.header.improve == 40
        assert identical(replay(journal)), seed
        unmarked = replace(journal, header=msgspec.structs.replace(journal.header, improve=msgspec.UNSET))
        others += not identical(replay(unmarked))
    assert others


def test_no_solution_is_no_assignment_that_robots_have_decided() -> None:
    """Found by `make simulate`: the robots had no values at the end, and that counted as their assignment."""
    variables = {f"R{name}": [Variable(name, Domain("D", (range(1),)))] for name in "AB"}
    own = [
        Constraint("C", Relation("R", 2, Semantics.SOFT, ((0, 0),), (cost,)), ("A", "B"), ("A", "B")) for cost in COSTS
    ]
    parts = {"RA": own[:1], "RB": own[1:]}
    team = assemble("none", variables, [], kind=ProblemKind.DISWCSP, extras=Extras(parts=parts))
    journal = recorded(team, Options(protocol="syncabb", runtime=Runtime.SIMULATOR, cache=False))
    assert journal.outcome is not None
    assert journal.outcome.verdict is Verdict.NO_SOLUTION
    found = replay(journal)
    assert identical(found), found


def test_tables_are_reused_in_replays_as_in_the_run() -> None:
    """Found by `make simulate`: journals do not keep the names of definitions, so s-dpop computed tables again."""
    options = Options(protocol="s-dpop", runtime=Runtime.SIMULATOR, cache=False)
    reused = 0
    for number in range(12):
        journal = recorded(random_changing_team(Random(f"reuse {number}"), 4), options)
        found = replay(journal)
        assert identical(found), (number, found)
        reused += any(isinstance(event, Sent) and event.type == "Reuse" for event in journal.events)
    assert reused
