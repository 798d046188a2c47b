"""Scores: gaps, areas and ranks computed by hand, and by scipy."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import pytest

from robochoc.experiments.task import Status
from robochoc.leaderboard.certificates import BEST_KNOWN, published
from robochoc.leaderboard.results import Budget, Entrant, LeaderboardResults, RunResult
from robochoc.leaderboard.scores import area, family_scores, gap, ranks_of
from robochoc.leaderboard.tables import family_tables, holders, overall
from robochoc.model.outcome import Verdict

COSTS, HARD = "random-small-0", "coloring-hard-small-0"
BEST = published()[COSTS].cost or 0
BUDGET = Budget(messages=100)


def answer(cost: int | None, curve: Sequence[tuple[int, int]] = (), verdict: Verdict = Verdict.SOLUTION) -> RunResult:
    return RunResult(
        instance=COSTS, protocol="a", status=Status.DONE, verdict=verdict, cost=cost, curve=list(curve), messages=50
    )


def test_gaps() -> None:
    best = published()[COSTS]
    assert gap(answer(BEST), best) == 0
    assert gap(answer(2 * BEST), best) == pytest.approx(0.5)
    assert gap(answer(-1), best) == 1
    assert gap(answer(None, verdict=Verdict.UNKNOWN), best) == 1
    assert gap(answer(BEST, verdict=Verdict.UNKNOWN), best) == 0
    zero = msgspec.structs.replace(best, cost=0, bound=0)
    assert gap(answer(0), zero) == 0
    assert gap(answer(7), zero) == 1


def test_answers_between_the_best_known_one_and_the_bound_have_no_gap() -> None:
    best = msgspec.structs.replace(published()[COSTS], verdict=BEST_KNOWN, cost=100, bound=80)
    assert [gap(answer(cost), best) for cost in (79, 80, 90, 100, 125)] == [pytest.approx(0.21), 0, 0, 0, 0.2]
    assert [best.is_beyond_bound(cost, is_maximised=False) for cost in (79, 80, 100)] == [True, False, False]
    profit = msgspec.structs.replace(best, bound=120)
    assert [gap(answer(cost), profit) for cost in (80, 100, 120)] == [pytest.approx(0.2), 0, 0]
    assert [profit.is_beyond_bound(cost, is_maximised=True) for cost in (100, 120, 121)] == [False, False, True]


def test_areas() -> None:
    best = published()[COSTS]
    assert area(answer(None, verdict=Verdict.UNKNOWN), best, BUDGET) == 1
    assert area(answer(BEST, [(0, BEST)]), best, BUDGET) == 0
    # Nothing for 10 messages, then half the gap for 30, then the optimum.
    assert area(answer(BEST, [(10, 2 * BEST), (40, BEST)]), best, BUDGET) == pytest.approx((10 + 15) / 100)
    # What is found after the budget does not count.
    assert area(answer(BEST, [(10, 2 * BEST), (400, BEST)]), best, BUDGET) == pytest.approx((10 + 45) / 100)


def test_areas_without_costs_and_with_changes() -> None:
    hard = published()[HARD]
    right = msgspec.structs.replace(answer(None), instance=HARD, verdict=hard.verdict)
    assert area(right, hard, BUDGET) == pytest.approx(0.5)
    assert area(msgspec.structs.replace(right, verdict=Verdict.UNKNOWN), hard, BUDGET) == 1
    assert area(answer(1), published()["dynamic-small-0"], BUDGET) is None


def test_ties_share_their_mean_rank() -> None:
    ranks = ranks_of({"a": [0, 0.5], "b": [0, 0.1], "c": [1, 0.1]})
    assert ranks == {"a": [1.5, 3.0], "b": [1.5, 1.5], "c": [3.0, 1.5]}


def results(*runs: RunResult) -> LeaderboardResults:
    names = dict.fromkeys(run.protocol for run in runs)
    return LeaderboardResults(
        format=1,
        benchmark_set=1,
        robochoc="1",
        seed=0,
        budget=BUDGET,
        entrants=[Entrant(name=name) for name in names],
        runs=sorted(runs, key=lambda run: run.instance),
    )


def ten_of_each(**factors: int) -> list[RunResult]:
    """Return runs of protocols on ten instances, with costs of the optimum times a factor plus the seed."""
    found = []
    for name, factor in factors.items():
        for seed in range(10):
            one = f"random-small-{seed}"
            best = published()[one].cost or 0
            cost = best * factor + (seed if factor > 1 else 0)
            found.append(
                RunResult(instance=one, protocol=name, status=Status.DONE, verdict=Verdict.SOLUTION, cost=cost)
            )
    return found


def test_the_best_are_those_that_are_not_significantly_worse() -> None:
    refused = [RunResult(instance=f"random-small-{seed}", protocol="none", status=Status.REFUSED) for seed in range(10)]
    found = family_scores(results(*ten_of_each(one=1, same=1, worse=2), *refused), "random", "small")
    assert found.refused == ("none",)
    assert [(one.protocol, one.rank.mean, one.is_best, one.best) for one in found.scores] == [
        ("one", 1.5, True, 10),
        ("same", 1.5, True, 10),
        ("worse", 3.0, False, 0),
    ]
    assert found.p is not None
    assert found.p < 0.001


def test_protocols_without_answers_are_not_the_best() -> None:
    nothing = [
        RunResult(instance=f"random-small-{seed}", protocol=name, status=Status.LIMIT, verdict=Verdict.UNKNOWN)
        for seed in range(10)
        for name in ("a", "b")
    ]
    found = family_scores(results(*nothing), "random", "small")
    assert [one.is_best for one in found.scores] == [False, False]
    assert found.p is None


def test_tables_and_holders() -> None:
    runs = results(*ten_of_each(one=1, worse=2))
    headings, lines = overall(runs, "small")
    assert dict(zip(headings, lines[0], strict=True)) == {
        "protocol": "one",
        "families": "1",
        "best in": "1",
        "best answers": "10",
        "proofs": "0",
        "instances": "10",
        "mean gap": "0.000",
    }
    (table,) = family_tables(runs, "small")
    assert table.family == "random"
    assert [line[0] for line in table.lines] == ["one*", "worse"]
    assert "messages" not in table.headings
    assert {name: [run.protocol for run in own] for name, own in holders(runs.runs).items()} == {
        f"random-small-{seed}": ["one"] for seed in range(10)
    }
