"""What constraints mean when robots are absent, in whole runs, held against brute force over the definition."""

from __future__ import annotations

import math

import pytest

import robochoc
from robochoc.communication.kill_schedule import Kill
from robochoc.solver.errors import UnsupportedError
from tests.support.absence_models import AbsenceModel
from tests.support.examples import are_the_same, count, drawn

pytestmark = pytest.mark.fresh
MINIMIZING = ("sfb", "dpop", "afb", "adopt", "bnb-adopt", "syncbb", "ncbb", "pt-fb", "hs-cai", "o-dpop", "mb-dpop")
SATISFYING = ("abt", "afc", "awc", "sfb", "dynabt")


@count("models", 16, 1000)
def test_as_few_as_possible_withdraw(models: int) -> None:
    aside = impossible = 0
    for seed in range(models):
        chance = drawn(f"absence {seed}")
        case = AbsenceModel(chance)
        weight, cost = case.minimum()
        protocol = chance.choice(MINIMIZING if case.has_costs else (*MINIMIZING, "abt", "afc", "central"))
        outcome = case.model.solve(protocol, runtime="simulator", withdraw="minimum", verify=protocol == "sfb")
        if weight == math.inf:
            impossible += 1
            assert outcome.verdict == "no-solution", seed
            assert "must not withdraw" in (outcome.reason or ""), seed
            continue
        aside += bool(outcome.withdrawn)
        assert outcome.verdict in {"optimal", "solution"}, seed
        assert sum(case.weights[name] for name in outcome.withdrawn) == weight, seed
        assert case.price(case.values_by_robot(outcome.values)) == cost, seed
        assert not case.has_costs or outcome.cost == cost, seed
        assert not outcome.dropped_constraints or outcome.withdrawn, seed
    assert (aside > models // 8 and impossible) or not are_the_same()


@count("models", 15, 700)
def test_robots_withdraw_one_after_the_other_where_constraints_are_dropped(models: int) -> None:
    ran, refused = 0, list[str]()
    for seed in range(models * 3):
        case = AbsenceModel(drawn(f"absence {seed}"))
        if case.has_costs:
            continue
        try:
            outcome = case.model.solve("abt", runtime="simulator", withdraw="maximal")
        except UnsupportedError as why:
            refused.append(str(why))
            continue
        ran += 1
        present = tuple(name for name in case.names if name not in outcome.withdrawn)
        values = case.values_by_robot(outcome.values)
        assert case.price(values) == 0, seed
        for name in outcome.withdrawn:
            assert min(case.price({**values, name: value}) for value in case.domains[name]) == math.inf, seed
        assert {*present} == {*values}, seed
    assert (ran and refused) or not are_the_same()
    assert all("restated when a robot is absent" in why for why in refused)


@count("models", 20, 800)
def test_robots_leave_by_events(models: int) -> None:
    unsolved = 0
    for seed in range(models):
        chance = drawn(f"absence {seed}")
        case = AbsenceModel(chance)
        gone = chance.sample(case.names, chance.randint(1, 2))
        protocol = chance.choice(("sfb", "dpop", "afb") if case.has_costs else SATISFYING)
        check(case, case.without(gone).solve(protocol, runtime="simulator"), gone, seed)
        unsolved += case.best([name for name in case.names if name not in gone]) == math.inf
    assert 0 < unsolved < models or not are_the_same()


@count("models", 3, 300)
def test_robots_are_lost(models: int) -> None:
    for seed in range(models):
        chance = drawn(f"absence {seed}")
        case = AbsenceModel(chance)
        lost = chance.choice(case.names)
        protocol = chance.choice(("sfb", "dpop") if case.has_costs else SATISFYING)
        outcome = case.model.solve(protocol, runtime="processes", kill=[Kill(lost, 0)], on_loss="withdraw")
        check(case, outcome, outcome.lost, seed)


@pytest.mark.slow
def test_robots_that_come_back_have_their_constraints_again(tmp_path_factory: pytest.TempPathFactory) -> None:
    for seed in range(100):
        chance = drawn(f"absence {seed}")
        case = AbsenceModel(chance)
        folder = tmp_path_factory.mktemp("team") / "absence"
        case.model.save(folder)
        lost = chance.choice(case.names)
        protocol = "sfb" if case.has_costs else chance.choice(SATISFYING)
        outcome = robochoc.load(folder).solve(protocol, runtime="processes", kill=[Kill(lost, 0)], spares=1)
        check(case, outcome, (), seed)


@pytest.mark.slow
def test_as_few_as_possible_withdraw_on_other_runtimes() -> None:
    for seed in range(150):
        case = AbsenceModel(drawn(f"absence {seed}"))
        weight, cost = case.minimum()
        for runtime in ("processes", "network") if seed < 30 else ("processes",):
            outcome = case.model.solve("sfb", runtime=runtime, withdraw="minimum")
            assert (outcome.verdict == "no-solution") is (weight == math.inf), (seed, runtime)
            if weight < math.inf:
                assert sum(case.weights[name] for name in outcome.withdrawn) == weight, (seed, runtime)
                assert case.price(case.values_by_robot(outcome.values)) == cost, (seed, runtime)


def check(case: AbsenceModel, outcome: robochoc.Solution, gone: tuple[str, ...] | list[str], seed: int) -> None:
    """Check an outcome without the robots `gone` against brute force."""
    best = case.best([name for name in case.names if name not in gone])
    assert (outcome.verdict == "no-solution") is (best == math.inf), seed
    if best < math.inf:
        assert outcome.verdict in {"optimal", "solution"}, seed
        assert case.price(case.values_by_robot(outcome.values)) == best, seed


def test_constraints_are_listed_when_their_robots_leave_one_after_the_other() -> None:
    model = robochoc.Model("leaving")
    a, b, _ = (model.robot(name).variable("x", [1, 2]) for name in "abc")
    model.add(a + b <= 3, name="sum")
    for name in "ab":
        model.after_solution().remove_robot(name)
    outcome = model.solve("sfb", runtime="simulator")
    assert [(one.name, one.robots) for one in outcome.dropped_constraints] == [("sum", ("a", "b"))]
    assert [len(epoch.dropped_constraints) for epoch in outcome.epochs] == [0, 0, 1]


def test_members_of_sets_are_restated_and_private_constraints_allow_first_fit() -> None:
    model = robochoc.Model("sets")
    posts = [model.robot(name).variable("post", [1, 2, 3]) for name in "abc"]
    one, two, three = (post.is_in([1, 3]) for post in posts)
    model.add((one + two + three).is_in([0, 3]), name="together")
    model.add(robochoc.any_of(post.is_in([2, 3]) for post in posts), when_absent="restate")
    model.add(posts[0] != posts[1], posts[1] != posts[2], posts[0] != posts[2])
    model.add(sum(posts) >= 3)
    assert model.solve("dpop", runtime="simulator", withdraw="minimum").withdrawn == ("a", "b", "c")
    private = robochoc.Model("private")
    left, right = (private.robot(name).variable("x", [1, 2]) for name in "ab")
    private.add(left + 0 <= 1, right <= 1, left != right)
    assert len(private.solve("abt", runtime="simulator", withdraw="maximal").withdrawn) == 1


def test_a_soft_cumulative_holds_for_the_last_task() -> None:
    model = robochoc.Model("tasks")
    starts = [model.robot(name).variable("start", [1, 2]) for name in "abc"]
    model.add(robochoc.cumulative(starts, [2, 1, 1], [2, 1, 1], 1), cost=4, name="crane")
    model.minimize(sum(starts))
    event = model.after_solution()
    event.remove_robot("b")
    event.remove_robot("c")
    outcome = model.solve("dpop", runtime="simulator")
    assert (outcome.cost, outcome.dropped_constraints) == (5, ())
