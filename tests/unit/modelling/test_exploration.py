"""All solutions of a model, and minimal conflicts, compared with brute force."""

from __future__ import annotations

import itertools
from random import Random
from typing import Any

import pytest

import robochoc
from robochoc.modelling.exploration import ExplorationError
from robochoc.solver import listing
from robochoc.solver.ace import AceProcess
from robochoc.solver.central import CentralSolver
from robochoc.solver.compile import CompileLimits
from robochoc.verification.checker import RefutedError
from tests.support.cases import looped
from tests.support.limits import HANG_S

DIFFERENCES = (-1, 0, 1)


def random_model(seed: int) -> tuple[robochoc.Model, list[tuple[int, int, int]]]:
    """Return a model of four robots, and its constraints: x[i] - x[j] is not a number."""
    chance = Random(seed)
    model = robochoc.Model(f"m{seed}")
    x = [model.robot(f"r{i}").variable("x", range(2)) for i in range(4)]
    pairs = [(i, j) for i in range(4) for j in range(4) if i != j]
    rules = [(*chance.choice(pairs), chance.choice(DIFFERENCES)) for _ in range(chance.randrange(4, 11))]
    for i, j, number in rules:
        model.add(x[i] - x[j] != number)
    return model, rules


def solved_by(rules: list[tuple[int, int, int]]) -> list[tuple[int, ...]]:
    every = itertools.product(range(2), repeat=4)
    return [values for values in every if all(values[i] - values[j] != number for i, j, number in rules)]


@looped("seed", range(30))
def test_all_solutions_and_conflicts(seed: int) -> None:
    model, rules = random_model(seed)
    expected = solved_by(rules)
    found = [tuple(solution.values.values()) for solution in model.solutions()]
    assert sorted(map(str, found)) == sorted(map(str, expected))
    conflict = model.conflict()
    assert (conflict is None) is bool(expected)
    if conflict is not None:
        places = [next(i for i, one in enumerate(model.constraints) if one is constraint) for constraint in conflict]
        assert not solved_by([rules[place] for place in places])
        for place in places:
            assert solved_by([rules[other] for other in places if other != place])
    assert len(model.constraints) == len(rules)


def test_the_cheapest_solutions_come_first() -> None:
    model = robochoc.Model()
    x = [model.robot(f"r{i}").variable("x", range(3)) for i in range(3)]
    model.add(robochoc.all_different(x))
    model.minimize(x[0] + 2 * x[1])
    costs = [solution.cost for solution in model.solutions(limit=4)]
    assert costs == sorted(a + 2 * b for a, b, _ in itertools.permutations(range(3)))[:4]
    assert [one.cost for one in model.solutions("sfb", limit=2, seed=3)] == costs[:2]


@looped("seed", range(20))
def test_listing_divides_large_parts(seed: int) -> None:
    chance = Random(seed)
    model = robochoc.Model()
    domains = [range(chance.randrange(1, 4)) for _ in range(5)]
    x = [model.robot(f"r{i}").variable("x", domain) for i, domain in enumerate(domains)]
    pairs = [(*chance.sample(range(5), 2), chance.choice(DIFFERENCES)) for _ in range(chance.randrange(5))]
    for i, j, number in pairs:
        model.add(x[i] - x[j] != number)
    every = itertools.product(*domains)
    expected = [row for row in every if all(row[i] - row[j] != number for i, j, number in pairs)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(listing, "BATCHES", (1, 2, 3))
        found = [tuple(solution[one] for one in x) for solution in model.solutions()]
        assert sorted(map(str, found)) == sorted(map(str, expected))
        weights = [chance.randrange(4) for _ in x]
        model.minimize(sum(weight * one for weight, one in zip(weights, x, strict=True)))
        costs = [solution.cost for solution in model.solutions()]
    prices = (sum(weight * value for weight, value in zip(weights, row, strict=True)) for row in expected)
    assert costs == sorted(prices)


def test_ace_lists_many_solutions_and_early_stops_end_it() -> None:
    model = robochoc.Model()
    x = [model.robot(f"r{i}").variable("x", range(6)) for i in range(6)]
    model.add(robochoc.all_different(x))
    solutions = model.solutions(local=CompileLimits(always_ace=True))
    first = [next(solutions) for _ in range(12)]
    solutions.close()  # type: ignore[attr-defined] # a generator
    assert len({tuple(one.values.values()) for one in first}) == 12
    every = [tuple(one[name] for name in x) for one in model.solutions(local=CompileLimits(always_ace=True))]
    assert sorted(every) == [*itertools.permutations(range(6))]


def test_wrong_answers_of_the_listing_solver_are_refuted(monkeypatch: pytest.MonkeyPatch) -> None:
    model, rules = random_model(3)
    wrong = next(row for row in itertools.product(range(2), repeat=4) if row not in solved_by(rules))
    answers = iter([dict(zip(model.variables, wrong, strict=True))])
    monkeypatch.setattr(CentralSolver, "solutions", lambda *_: answers)
    with pytest.raises(RefutedError, match="the checker refutes"):
        list(model.solutions())


def test_costs_and_parts_of_robots_in_conflicts() -> None:
    model = robochoc.Model()
    robot = model.robot("a")
    x, y = robot.variable("x", range(3)), model.robot("b").variable("y", range(3))
    model.add(x == 2, cost=5)
    low = model.add(x < 2, name="low")
    model.add(y > 0, name="free")
    high = model.add(x + y > 3, name="high")
    model.minimize(x + y)
    assert model.conflict() == (low, high)
    model.remove(high)
    assert model.conflict() is None


def test_the_time_limit() -> None:
    model, _ = random_model(3)
    with pytest.raises(ExplorationError, match="within 0 s"):
        model.conflict(timeout=0)


@looped(
    ("protocol", "options"),
    [("abt", {"messages": 1}), ("mgm", {}), ("central", {"timeout": 0}), ("dsa", {"settings": {"cycles": 1}})],
)
def test_a_search_without_a_verdict_does_not_end_the_list_silently(protocol: str, options: dict[str, Any]) -> None:
    model, _ = random_model(3)
    with pytest.raises(ExplorationError, match=r"ended without a verdict: [^N]"):
        list(model.solutions(protocol, **options))


def test_withdrawal_events_and_loaded_constraints_are_refused() -> None:
    model, _ = random_model(3)
    with pytest.raises(robochoc.OptionError, match="cannot be used with withdraw"):
        list(model.solutions(withdraw=True))
    with pytest.raises(robochoc.UnsupportedError, match="loaded from files"):
        robochoc.Model.of(model.team).conflict()
    model.after_solution().add(model["r0.x"] == 1)
    for explore in (model.conflict, lambda: list(model.solutions())):
        with pytest.raises(robochoc.UnsupportedError, match="do not change"):
            explore()


@pytest.mark.parametrize("limit", [-1, "3", 1.5])
def test_a_wrong_limit_is_refused(limit: Any) -> None:  # noqa: ANN401 - wrong on purpose
    with pytest.raises(robochoc.OptionError, match="limit="):
        next(random_model(3)[0].solutions(limit=limit))


def test_all_searches_of_the_central_solver_use_one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[AceProcess] = []
    start = AceProcess._start  # noqa: SLF001 - counts the processes

    def counted_start(process: AceProcess) -> None:
        started.append(process)
        start(process)

    monkeypatch.setattr(AceProcess, "_start", counted_start)
    monkeypatch.setattr("robochoc.solver.central.HEDGE_S", HANG_S)  # however busy the machine is
    model, _ = random_model(3)
    assert len(list(model.solutions(local=CompileLimits(always_ace=True)))) > 1
    assert len(started) == 1


def test_a_cleared_objective_leaves_no_trace() -> None:
    model = robochoc.Model()
    x = model.robot("a").variable("x", range(3))
    model.minimize(x + 5)
    model.clear_objective()
    assert model.team.kind == "DisCSP"
    model.maximize(x)
    assert model.solve("dpop").cost == 2
