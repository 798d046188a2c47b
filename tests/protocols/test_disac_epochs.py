"""`--preprocess ac` where the problem changes: domains are made consistent anew before each epoch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from random import Random

import pytest

from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import (
    AddConstraint,
    Change,
    Constraint,
    Relation,
    RemoveAgent,
    RemoveConstraint,
    ScenarioEvent,
    Semantics,
    Team,
)
from robochoc.replay.replay import replay
from robochoc.run import Options, Runtime, solve
from robochoc.run.options import Preprocess
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.cases import looped
from tests.support.changing_costs import agrees_on_costs, changing_cost_team
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.problems import team_of
from tests.support.random_changes import check_epochs, random_changing_team
from tests.support.random_options import random_schedule
from tests.support.recorded_journals import record
from tests.support.small_teams import DIFFERENT

AC = Options(runtime=Runtime.SIMULATOR, preprocess=Preprocess.AC)
SATISFYING = ("abt", "afc-ng", "agile-abt", "awc", "dynabt", "sbt", "sfb")


def below(left: str, right: str) -> Constraint:
    """`left` < `right`, for values from 1 to 3."""
    relation = Relation("less", 2, Semantics.SUPPORTS, ((1, 2), (1, 3), (2, 3)))
    return Constraint(f"{left}{right}", relation, (left, right), (left, right))


def chain(*changes: Sequence[Change]) -> Team:
    """A < B < C: one value is left to each."""
    team = team_of(dict.fromkeys("ABC", (1, 2, 3)), [below("A", "B"), below("B", "C")])
    return replace(team, scenario=tuple(ScenarioEvent(tuple(one)) for one in changes))


LOOSER: list[Change] = [RemoveConstraint("RC", "RB", "BC")]
IMPOSSIBLE: list[Change] = [AddConstraint("RB", "RA", below("B", "A"))]
POSSIBLE: list[Change] = [RemoveConstraint("RB", "RA", "BA")]
GONE: list[Change] = [RemoveAgent("RC")]


def removed_before_last(team: Team, protocol: str) -> int:
    """Return how many values the last epoch's preprocessing has removed."""
    return removed(team, protocol) - removed(replace(team, scenario=team.scenario[:-1]), protocol)


def removed(team: Team, protocol: str) -> int:
    outcome = solve(team, replace(AC, protocol=protocol))
    assert outcome.preprocessing is not None
    return outcome.preprocessing.removed


@looped("protocol", ["abt", "dynabt"])
def test_values_that_a_removed_constraint_ruled_out_come_back(protocol: str) -> None:
    """Without B < C, only A = 3 and B = 1 have no support."""
    assert removed(chain(), protocol) == 6
    assert removed_before_last(chain(LOOSER), protocol) == 2


def verdicts(outcome: Outcome) -> list[Verdict]:
    return [epoch.verdict for epoch in outcome.epochs]


@pytest.mark.parametrize(
    ("protocol", "runtime"),
    [
        *((name, Runtime.SIMULATOR) for name in ("abt", "dynabt", "s-dpop")),
        *(pytest.param(name, Runtime.PROCESSES, marks=pytest.mark.slow) for name in ("abt", "dynabt", "s-dpop")),
    ],
)
def test_the_protocol_passes_over_epochs_in_which_a_domain_becomes_empty(protocol: str, runtime: Runtime) -> None:
    no, yes = Verdict.NO_SOLUTION, Verdict.SOLUTION
    for changes, expected in (
        ([IMPOSSIBLE, POSSIBLE, LOOSER], [yes, no, yes, yes]),
        ([LOOSER, IMPOSSIBLE, GONE, POSSIBLE], [yes, yes, no, no, yes]),
    ):
        outcome = solve(chain(*changes), replace(AC, protocol=protocol, runtime=runtime))
        assert verdicts(outcome) == expected
        for epoch in outcome.epochs:
            assert bool(epoch.witness) is (epoch.verdict is no)
            assert bool(epoch.metrics.messages) is (epoch.verdict is yes) or protocol == "dynabt"


def test_the_first_epoch_may_have_no_solution() -> None:
    team = chain(POSSIBLE)
    first = team_of(dict.fromkeys("ABC", (1, 2, 3)), [below("A", "B"), below("B", "A"), below("B", "C")])
    for protocol in ("abt", "dynabt", "s-dpop"):
        outcome = solve(replace(first, scenario=team.scenario), replace(AC, protocol=protocol))
        assert verdicts(outcome) == [Verdict.NO_SOLUTION, Verdict.SOLUTION]


@looped("protocol", ["abt", "dynabt"])
def test_a_proof_that_rests_on_values_that_have_come_back_is_given_up(protocol: str) -> None:
    """D takes 3 from all others, who are three with two values; then it leaves."""
    differing = [Constraint("".join(two), DIFFERENT, two, two) for two in combinations("DABC", 2)]
    team = team_of({"D": (3,), **dict.fromkeys("ABC", (1, 2, 3))}, differing)
    team = replace(team, scenario=(ScenarioEvent((RemoveAgent("RD"),)),))
    outcome = solve(team, replace(AC, protocol=protocol))
    assert outcome.epochs[0].metrics.messages  # it was the search that found that there is none
    assert verdicts(outcome) == [Verdict.NO_SOLUTION, Verdict.SOLUTION]


@count("problems", 7, 1500)
def test_each_epoch_has_the_verdict_of_brute_force(problems: int) -> None:
    chance, ended = Random("ac epochs"), 0
    for number in range(problems):
        protocol = SATISFYING[number % len(SATISFYING)]
        ended += check_epochs(
            random_changing_team(chance), replace(random_schedule(chance), protocol=protocol, preprocess=Preprocess.AC)
        )
    assert ended > 8 * problems


MINIMISING = [
    name
    for name in protocol_names()
    if (traits := protocol_named(name).traits).costs
    and traits.complete
    and traits.n_ary
    and not traits.allocates
    and not traits.secret_keys
    and not traits.lacks
]


@count("problems", 4, 600)
def test_each_epoch_has_the_least_cost(problems: int) -> None:
    chance, ended = Random("ac costs"), 0
    for number in range(problems):
        protocol = "s-dpop" if number % 2 else chance.choice(MINIMISING)
        options = replace(random_schedule(chance), protocol=protocol, preprocess=Preprocess.AC)
        ended += agrees_on_costs(changing_cost_team(chance, 5), options)[0]
    assert ended > 2 * problems


@pytest.mark.more
@count("problems", 2, 20)
def test_the_same_in_processes(problems: int) -> None:
    chance = Random("ac in processes")
    for number in range(problems):
        protocol = SATISFYING[-number % len(SATISFYING)]
        check_epochs(random_changing_team(chance), Options(protocol=protocol, preprocess=Preprocess.AC, timeout=HANG_S))


@looped("protocol", ["abt", "dynabt", "s-dpop"])
@count("problems", 2, 60)
def test_its_journal_is_replayed(protocol: str, problems: int) -> None:
    """Runs of both kinds alternate in it; the robots of the protocol stay what they were."""
    chance = Random(f"ac journals {protocol}")
    teams = [chain(IMPOSSIBLE, POSSIBLE, LOOSER), *(random_changing_team(chance) for _ in range(problems))]
    for team in teams:
        done = replay(record(team, replace(AC, protocol=protocol)))
        assert done.difference is None
        assert not done.contradictions


def test_a_limit_ends_it_in_the_middle() -> None:
    outcome = solve(chain(LOOSER), replace(AC, protocol="abt", messages=3))
    assert outcome.epochs[0].verdict is Verdict.UNKNOWN
    assert outcome.reason == "the limit of messages was reached (--messages 3)"
