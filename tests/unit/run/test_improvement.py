"""`--improve`: after the deadline the team searches on, and each answer that is better is published, checked."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from types import SimpleNamespace

import pytest

from robochoc.communication.run_result import RobotsLostError
from robochoc.formats.result import read_result, result_json
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.generators.scenario import random_scenario
from robochoc.model.change import team_after_events
from robochoc.model.cost_units import CostUnits
from robochoc.model.outcome import EpochOutcome, Improvement, Outcome, Verdict
from robochoc.model.problem import INFINITE, ProblemKind, Team
from robochoc.run import CENTRAL, Options, Runtime, Withdrawal, solve
from robochoc.run.evaluation import Answer
from robochoc.run.improvement import Improvements, Rank
from robochoc.run.options import OnLoss, Preprocess, ScheduleName
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.encoding import UnsupportedError
from robochoc.verification.checker import RefutedError, assignment_cost, violations
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team
from tests.support.counted_clock import time_passes_at_each_look
from tests.support.examples import count
from tests.support.faults import own_children
from tests.support.problems import random_team

LONG = {"cycles": "100000"}
FOUND = {Verdict.SOLUTION, Verdict.OPTIMAL}


class Told:
    """An audience that keeps all that it is told, and checks it by itself."""

    def __init__(self, news_at: int | None = None) -> None:
        self.heard: list[tuple[Team, EpochOutcome, tuple[str, ...]]] = []
        self._news_at = news_at

    def improve(self, team: Team, /, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        assert list(violations(team, epoch.assignment, withdrawn)) == []
        assert epoch.cost is not None
        assert epoch.verified
        self.heard.append((team, epoch, tuple(withdrawn)))

    def has_news(self, _team: Team) -> bool:
        return self._news_at is not None and len(self.heard) >= self._news_at

    @property
    def costs(self) -> list[float]:
        return [float(epoch.cost or 0) for _, epoch, _ in self.heard]


@pytest.fixture
def a_second_a_look() -> Iterator[None]:
    """Let a second pass whenever somebody looks at the clock: so as much is done on every machine."""
    with time_passes_at_each_look():
        yield


def costly(size: int = 8, **more: object) -> Team:
    return random_csp(size, 4, 0.6, 0, 1, max_cost=50, **more)  # type: ignore[arg-type]


def simulated(protocol: str, deadline: float, improve: float, **more: object) -> Options:
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, deadline=deadline, improve=improve)
    return replace(options, **more)  # type: ignore[arg-type]


def agreed(team: Team, outcome: Outcome, told: Told) -> None:
    """Check what was published against each other, against the outcome, and against brute force."""
    assert told.costs == sorted(set(told.costs), reverse=True)
    best = least_cost(team)
    for _, epoch, withdrawn in told.heard:
        assert epoch.cost == assignment_cost(team, epoch.assignment)
        assert not withdrawn
        assert epoch.cost >= best
    if told.heard:
        last = told.heard[-1][1]
        assert (outcome.assignment, outcome.cost) == (last.assignment, last.cost)
        assert outcome.verdict in FOUND
    assert [one.cost for one in outcome.improvements] == told.costs[len(told.costs) - len(outcome.improvements) :]
    if outcome.verdict is Verdict.OPTIMAL:
        assert (outcome.cost, outcome.deadline, outcome.bound) == (best, None, None)
    if outcome.verdict is Verdict.NO_SOLUTION:
        assert best == INFINITE
    if outcome.bound is not None and best < INFINITE:
        assert outcome.bound <= best


ANYTIME = [
    name
    for name in protocol_names()
    if protocol_named(name).__module__.startswith("robochoc.") and protocol_named(name).traits.costs
]


@pytest.mark.usefixtures("a_second_a_look")
@count("runs", 12, 3000)
def test_what_is_published_only_gets_better_and_is_what_the_checker_says(runs: int) -> None:
    """Random problems, protocols, schedules and limits; the clock makes a snapshot of nearly each state."""
    published = improved = proven = 0
    for number in range(runs):
        chance = Random(number)
        name = ANYTIME[number % len(ANYTIME)]
        team = random_cost_team(chance, n_ary=protocol_named(name).traits.n_ary)
        settings = LONG if "cycles" in protocol_named(name).settings.__struct_fields__ else {}
        options = simulated(
            name,
            chance.choice((1, 20, 60, 200)),
            chance.choice((1, 50, 400, 1000)),
            schedule=chance.choice([*ScheduleName]),
            seed=number,
            settings=settings,
            preprocess=Preprocess.AC if chance.random() < 0.1 else None,
            message_loss=0.1 if chance.random() < 0.1 else 0.0,
        )
        if options.message_loss:
            options = replace(options, preprocess=None)
        told = Told()
        try:
            outcome = solve(team, options, audience=told)
        except UnsupportedError:
            continue
        agreed(team, outcome, told)
        published += bool(outcome.improvements)
        improved += len(outcome.improvements) > 1
        proven += bool(outcome.improvements) and outcome.verdict is Verdict.OPTIMAL
    assert published > runs / 5
    assert improved >= runs / 30
    assert proven >= runs / 50


@count("runs", 12, 3 * len(ANYTIME))
def test_whoever_is_watched_does_the_same(runs: int) -> None:
    """Snapshots change nothing: robots say the same, and end with the same, unless what they had was better."""
    for number in range(runs):
        name = ANYTIME[number * 5 % len(ANYTIME)]
        team = random_cost_team(Random(number), n_ary=protocol_named(name).traits.n_ary)
        options = Options(protocol=name, runtime=Runtime.SIMULATOR)
        try:
            alone = solve(team, options)
        except UnsupportedError:
            continue
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("robochoc.run.improvement.PERIOD_S", 0.001)
            patch.setattr("robochoc.run.improvement._SHARE", 1)
            watched = solve(team, replace(options, deadline=3600, improve=1), audience=Told())
        assert replace(watched.metrics, wall_s=0, compile_s=0) == replace(alone.metrics, wall_s=0, compile_s=0), name
        assert watched.verdict == alone.verdict, name
        assert watched.cost == alone.cost or float(watched.cost or 0) < float(alone.cost or 0), name


@pytest.mark.usefixtures("a_second_a_look")
def test_utilities_rise() -> None:
    team = costly(costs=CostUnits(maximize=True, places=0, constant=0))
    for protocol in ("dsa", "afb"):
        told = Told()
        outcome = solve(team, simulated(protocol, 20, 500, settings=LONG if protocol == "dsa" else {}), audience=told)
        assert len(told.costs) > 1
        assert told.costs == sorted(set(told.costs))
        assert outcome.cost == told.costs[-1]


@pytest.mark.usefixtures("a_second_a_look")
def test_the_search_goes_on_until_the_optimum_is_proven() -> None:
    """What was published at the deadline is known not to be the last: the same search, which is not begun again."""
    team = costly(5)
    alone = solve(team, Options(protocol="syncbb", runtime=Runtime.SIMULATOR))
    told = Told()
    outcome = solve(team, simulated("syncbb", 30, 1_000_000), audience=told)
    assert len(outcome.improvements) > 2
    assert outcome.improvements[0].at_s < outcome.improvements[-1].at_s
    assert outcome.improvements[0].verdict is Verdict.SOLUTION
    assert (outcome.verdict, outcome.cost) == (Verdict.OPTIMAL, alone.cost)
    assert outcome.metrics.messages == alone.metrics.messages
    assert read_result(result_json(outcome)).improvements == tuple(
        one._replace(at_s=round(one.at_s, 6)) for one in outcome.improvements
    )


@pytest.mark.usefixtures("a_second_a_look")
def test_without_costs_the_first_solution_is_the_last() -> None:
    for protocol, team in (("dsa", random_csp(6, 4, 0.5, 0.1)), ("afb", queens3d(3, model="planar"))):
        told = Told()
        settings = LONG if protocol == "dsa" else {}
        outcome = solve(team, simulated(protocol, 1, 1_000_000, settings=settings), audience=told)
        assert len(told.heard) <= 1
        assert outcome.verdict in {Verdict.SOLUTION, Verdict.NO_SOLUTION}


@pytest.mark.usefixtures("a_second_a_look")
@count("runs", 4, 600)
def test_each_epoch_has_a_deadline_and_improvements_of_its_own(runs: int) -> None:
    improved = 0
    for number in range(runs):
        chance = Random(number)
        protocol = ("dsa", "afb", "bnb-adopt", "dpop")[number % 4]
        team = random_cost_team(chance, n_ary=protocol_named(protocol).traits.n_ary)
        try:
            team = random_scenario(team, 2, 0.3, seed=number, after=chance.choice((None, 40)))
        except ValueError:
            continue
        told = Told()
        settings = LONG if protocol == "dsa" else {}
        outcome = solve(team, simulated(protocol, 60, chance.choice((5, 400)), settings=settings), audience=told)
        assert len(outcome.epochs) == len(team.scenario) + 1
        for place, epoch in enumerate(outcome.epochs):
            now = team_after_events(team, place)
            own = [one for on, one, _ in told.heard if one.opened_by == epoch.opened_by and on.order == now.order]
            costs = [one.cost for one in epoch.improvements]
            assert costs == sorted({*costs}, key=lambda cost: -(cost or 0))
            assert [one.cost for one in own][len(own) - len(costs) :] == costs
            if costs:
                assert epoch.cost == costs[-1] == assignment_cost(now, epoch.assignment)
            if epoch.verdict is Verdict.OPTIMAL:
                assert epoch.cost == least_cost(now)
            improved += len(costs) > 1
        assert (outcome.verdict, outcome.cost) == (outcome.epochs[-1].verdict, outcome.epochs[-1].cost)
        assert outcome.improvements == outcome.epochs[-1].improvements
    assert improved


@pytest.mark.usefixtures("a_second_a_look")
def test_news_end_what_is_searched_for() -> None:
    outcome = solve(costly(), simulated("dsa", 20, 1_000_000, settings=LONG), audience=Told(news_at=1))
    assert len(outcome.improvements) == 1
    assert (outcome.verdict, outcome.deadline) == (Verdict.SOLUTION, 20)


@pytest.mark.usefixtures("a_second_a_look")
@count("runs", 8, 800)
def test_with_withdrawal_fewer_and_fewer_withdraw(runs: int) -> None:
    several = 0
    for number in range(runs):
        chance = Random(number)
        team = random_team(chance, n_ary=False) if number % 2 else queens3d(2)
        if any(robot.kind is ProblemKind.DISWCSP for robot in team.robots):
            continue
        protocol = ("bnb-adopt", "afb", "abt", "syncbb")[number % 4]
        told = Told()
        options = simulated(protocol, chance.choice((5, 60, 300)), chance.choice((200, 100_000)), seed=number)
        outcome = solve(team, replace(options, withdraw=Withdrawal.MINIMUM), audience=told)
        alone = solve(team, Options(protocol="sfb", runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MINIMUM))
        weight = {robot.name: robot.weight for robot in team.robots}
        weights = [sum(weight[name] for name in withdrawn) for _, _, withdrawn in told.heard]
        fewest = sum(weight[name] for name in alone.withdrawn)
        assert weights == sorted({*weights}, reverse=True)
        assert all(one >= fewest for one in weights)
        if told.heard:
            assert sum(weight[name] for name in outcome.withdrawn) == weights[-1]
        if outcome.verdict is Verdict.OPTIMAL:
            assert sum(weight[name] for name in outcome.withdrawn) == fewest
        several += len(weights) > 1
    assert several


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (Options(improve=1), "--improve goes on after --deadline"),
        (Options(protocol=CENTRAL, deadline=1, improve=1), "--deadline is for robots"),
    ],
)
def test_what_cannot_be_improved_is_refused(options: Options, why: str) -> None:
    with pytest.raises(UnsupportedError, match=why):
        solve(costly(), options)


# In real time


@pytest.mark.slow
@pytest.mark.parametrize("runtime", [Runtime.PROCESSES, Runtime.SIMULATOR, Runtime.ARRAYS])
@pytest.mark.parametrize("protocol", ["dsa", "mgm", "bnb-adopt", "afb", "sfb"])
def test_every_runtime_publishes_while_it_searches(runtime: Runtime, protocol: str) -> None:
    local = protocol in {"dsa", "mgm"}
    if runtime is Runtime.ARRAYS and not local:
        return
    team = random_csp(8, 4, 0.6, 0.0, seed=3, max_cost=50)
    told = Told(news_at=1)
    options = Options(protocol=protocol, runtime=runtime, deadline=0.3, improve=600, settings=LONG if local else {})
    outcome = solve(team, options, audience=told)
    agreed(team, outcome, told)
    assert outcome.verdict in FOUND
    assert told.heard


def test_processes_publish_while_they_search() -> None:
    told = Told()
    options = Options(protocol="dsa", runtime=Runtime.PROCESSES, deadline=0.3, improve=60, settings=LONG)
    outcome = solve(costly(), options, audience=Watcher(told))
    agreed(costly(), outcome, told)
    assert outcome.improvements
    assert outcome.deadline == 0.3


class Watcher(Told):
    """An audience for which the first answer is enough."""

    def __init__(self, told: Told) -> None:
        super().__init__(news_at=1)
        self.heard = told.heard


class Killer(Told):
    """An audience that kills a robot's process once something is published, and is content with what the others find.

    Processes are named by their robots.
    """

    def improve(self, team: Team, /, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        super().improve(team, epoch, withdrawn)
        if len(self.heard) == 1:
            victim = next(
                pid for pid in own_children() if Path(f"/proc/{pid}/comm").read_text().strip() == team.order[2]
            )
            os.kill(victim, signal.SIGKILL)

    def has_news(self, team: Team) -> bool:
        return self.heard[-1][0] is team and len(team.robots) < len(self.heard[0][0].robots)


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_a_robot_that_dies_meanwhile_ends_the_run_or_leaves() -> None:
    """What was published stands; nothing is left (a fixture looks)."""
    team = costly()
    options = Options(protocol="dsa", runtime=Runtime.PROCESSES, deadline=0.3, improve=600, settings=LONG)
    with pytest.raises(RobotsLostError, match=f"{team.order[2]} was lost"):
        solve(team, options, audience=Killer())
    told = Killer()
    outcome = solve(team, replace(options, on_loss=OnLoss.WITHDRAW), audience=told)
    assert outcome.lost == (team.order[2],)
    assert team.order[2] not in told.heard[-1][0]
    assert outcome.cost == told.heard[-1][1].cost == assignment_cost(told.heard[-1][0], outcome.assignment)
    assert outcome.verdict is Verdict.SOLUTION
    assert [epoch.verdict for epoch in outcome.epochs] == [Verdict.UNKNOWN, Verdict.SOLUTION]


# The rules, one by one


def answer(cost: int, verdict: Verdict = Verdict.SOLUTION, **more: object) -> Answer:
    known = Answer(verdict, assignment={"X": cost}, cost=cost, verified=True)
    return replace(known, **more)  # type: ignore[arg-type]


class Bench:
    """Improvements with a clock that is set, and snapshots that are given."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, has_costs: bool = True) -> None:
        self.now = 0.0
        self.published: list[tuple[float, int]] = []
        self.news = False
        monkeypatch.setattr("robochoc.run.improvement.time", SimpleNamespace(monotonic=lambda: self.now))
        self._given = Answer(Verdict.UNKNOWN)
        self.made = Improvements(
            began=0,
            deadline=1,
            evaluate=lambda _: self._given,
            rank=Rank(costly(), float),  # type: ignore[arg-type]
            has_costs=has_costs,
            bounded=True,
            publish=lambda one, _: self.published.append((self.now, int(one.cost or 0))),
            has_news=lambda: self.news,
        )

    def tick(self, at_s: float, given: Answer | None = None) -> None:
        self.now = at_s
        if self.made.wants_snapshot(at_s) and given is not None:
            self._given = given
            self.made.take(None)  # type: ignore[arg-type]


def test_nothing_before_the_deadline_and_the_best_then(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    for at_s, cost in ((0.2, 9), (0.5, 5), (0.8, 7)):
        bench.tick(at_s, answer(cost))
    assert bench.published == []
    assert bench.made.wait_s(0.8) <= 0.2
    bench.tick(1.0)
    assert bench.published == [(1.0, 5)]


def test_a_robot_that_computes_at_the_deadline_keeps_nobody_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.tick(0.5, answer(5))
    bench.tick(0.9)  # asked, and not answered
    bench.tick(1.0)
    assert bench.published == [(1.0, 5)]


def test_what_is_as_good_is_not_published_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots are under way: they are not sent elsewhere for nothing."""
    bench = Bench(monkeypatch)
    for at_s, cost in ((1.0, 5), (1.2, 5), (1.4, 6), (1.6, 4)):
        bench.tick(at_s, answer(cost))
    assert bench.published == [(1.0, 5), (1.6, 4)]
    final = bench.made.concluded(replace(answer(4, Verdict.OPTIMAL), assignment={"X": 0}), lost=False)
    assert (final.verdict, final.assignment) == (Verdict.OPTIMAL, {"X": 4})
    assert bench.published == [(1.0, 5), (1.6, 4)]
    assert [(one.at_s, one.cost) for one in final.improvements] == bench.published


def test_a_bound_proves_what_was_found_before(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.tick(1.0, answer(5, bound=3, deadline=1.0))
    bench.tick(1.2, answer(7, bound=5))
    assert bench.made.satisfied
    final = bench.made.concluded(Answer(Verdict.UNKNOWN, bound=4), lost=False)
    assert (final.verdict, final.cost, final.bound, final.deadline) == (Verdict.OPTIMAL, 5, None, None)


def test_a_limit_leaves_the_best_of_those_that_were_published(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.tick(1.0, answer(5, deadline=1.0))
    final = bench.made.concluded(Answer(Verdict.UNKNOWN, bound=4, reason="the time was over"), lost=False)
    assert (final.verdict, final.cost, final.bound, final.deadline) == (Verdict.SOLUTION, 5, 4, 1.0)
    assert final.reason is None


def test_the_end_may_be_better_than_all_before(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.tick(1.0, answer(5))
    bench.now = 2.0
    final = bench.made.concluded(answer(3, Verdict.OPTIMAL, ended=True), lost=False)
    assert (final.verdict, final.cost) == (Verdict.OPTIMAL, 3)
    assert bench.published == [(1.0, 5), (2.0, 3)]
    assert final.improvements[-1] == Improvement(2.0, Verdict.OPTIMAL, 3)


def test_who_ends_before_the_deadline_has_published_once_and_improved_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.tick(0.5, answer(5))
    final = bench.made.concluded(answer(3, Verdict.OPTIMAL, ended=True), lost=False)
    assert (final.verdict, final.cost, final.improvements) == (Verdict.OPTIMAL, 3, ())
    assert bench.published == [(0.5, 3)]


def test_a_limit_before_the_deadline_decides_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.tick(0.5, answer(5))
    unknown = Answer(Verdict.UNKNOWN, reason="so many messages have been sent (--messages 3)")
    assert bench.made.concluded(unknown, lost=False) == unknown
    assert bench.published == []


def test_after_a_loss_what_was_published_is_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.tick(1.0, answer(5))
    final = bench.made.concluded(Answer(Verdict.UNKNOWN), lost=True)
    assert (final.verdict, final.cost, len(final.improvements)) == (Verdict.UNKNOWN, None, 1)


def test_a_protocol_that_an_answer_refutes_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    for claim in (Answer(Verdict.NO_SOLUTION), answer(6, Verdict.OPTIMAL)):
        bench = Bench(monkeypatch)
        bench.tick(1.0, answer(5))
        with pytest.raises(RefutedError, match=r"5\)? was found"):
            bench.made.concluded(claim, lost=False)


def test_that_nobody_flies_is_an_answer_only_once_it_is_proven(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    nobody = answer(0, assignment={}, withdrawn=costly().order)
    bench.tick(1.0, nobody)
    assert bench.published == []
    final = bench.made.concluded(replace(nobody, verdict=Verdict.OPTIMAL, ended=True), lost=False)
    assert (final.verdict, final.withdrawn) == (Verdict.OPTIMAL, costly().order)


def test_news_count_once_something_is_published(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.news = True
    bench.tick(0.5, answer(5))
    assert not bench.made.satisfied
    bench.tick(1.0)
    bench.tick(1.2)
    assert bench.made.satisfied
