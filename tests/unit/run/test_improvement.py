"""`--improve` in the simulator: each answer after the deadline is better, published and checked."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from robochoc.formats.result import read_result, result_json
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.generators.scenario import random_scenario
from robochoc.model.change import team_after_events
from robochoc.model.cost_units import CostUnits
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind
from robochoc.run import CENTRAL, Options, Runtime, Withdrawal, solve
from robochoc.run.options import Preprocess, ScheduleName
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import assignment_cost
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team
from tests.support.examples import count
from tests.support.improvements import LONG, Told, agreed, costly, simulated
from tests.support.problems import random_team


def anytime_protocols() -> list[str]:
    """Return the names of our protocols that minimise costs."""
    protocols = ((name, protocol_named(name)) for name in protocol_names())
    return [name for name, one in protocols if one.__module__.startswith("robochoc.") and one.traits.costs]


@pytest.mark.usefixtures("a_second_a_look")
@count("runs", 12, 3000)
def test_what_is_published_only_gets_better_and_is_what_the_checker_says(runs: int) -> None:
    """Random problems, protocols, schedules and limits; the clock makes a snapshot of nearly each state."""
    anytime = anytime_protocols()
    published = improved = proven = 0
    for number in range(runs):
        chance = Random(number)
        name = anytime[number % len(anytime)]
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


@count("runs", 12, 141)
def test_whoever_is_watched_does_the_same(runs: int) -> None:
    """Snapshots change nothing: robots say the same, and end with the same, unless what they had was better."""
    anytime = anytime_protocols()
    for number in range(runs):
        name = anytime[number * 5 % len(anytime)]
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
    for protocol, deadline_s in (("dsa", 3), ("afb", 20)):
        told = Told()
        outcome = solve(
            team, simulated(protocol, deadline_s, 500, settings=LONG if protocol == "dsa" else {}), audience=told
        )
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
        (Options(improve=1), "--improve continues after --deadline"),
        (Options(protocol=CENTRAL, deadline=1, improve=1), "--deadline is for robots"),
    ],
)
def test_what_cannot_be_improved_is_refused(options: Options, why: str) -> None:
    with pytest.raises(UnsupportedError, match=why):
        solve(costly(), options)
