"""What results come to: medians where limits cut runs short, intervals, tests, profiles, cost over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from robochoc.experiments import statistics, summary
from robochoc.experiments.summary import Sample
from tests.support.examples import examples

pytest.importorskip("scipy")


def row(label: str, case: int, messages: float | None, status: str = "done", **more: object) -> dict[str, Any]:
    given = {
        "tightness": 0.5, "problem_seed": case, "key": f"{label}{case}", "problems": "random", "label": label,
        "seed": 0, "repetition": 1, "status": status, "verdict": "solution" if status == "done" else None,
        "digest": str(case), "messages": messages, "ncccs": None, "bytes": None, "simulated_s": None, "cost": None,
        "runtime": "simulator", "settings": {}, "order": "given", "schedule": "concurrent", "delay": 0,
        "withdraw": None, "channel": None, "protocol": label.split(maxsplit=1)[0],
        "team": f"team{case}", "cost_over_time": [],
    }  # fmt: skip
    return {**given, **more}


def rows(**values: Sequence[float | None]) -> list[dict[str, Any]]:
    return [row(label, case, one) for label, given in values.items() for case, one in enumerate(given)]


def test_medians_say_where_limits_leave_them_open() -> None:
    found = summary.sample([row("a", 1, 10), row("a", 2, 30, "limit"), row("a", 3, None, "crashed")], "messages")
    assert found == Sample((10.0, 30.0), ("1", "2"), censored=1, failed=1, open_ended=True)
    assert (found.median, found.open_ended, summary.cell(found)) == (20.0, True, ">= 20")
    closed = summary.sample([row("a", case, case, "limit" if case == 4 else "done") for case in range(5)], "messages")
    assert (closed.open_ended, summary.cell(closed)) == (False, "2")
    low = summary.sample([row("a", case, case, "limit" if case == 1 else "done") for case in range(5)], "messages")
    assert (low.open_ended, summary.cell(low)) == (True, ">= 2")
    by_itself = summary.sample([row("a", case, case, "ended") for case in range(5)], "messages")
    assert (by_itself.open_ended, by_itself.censored) == (False, 0)
    assert summary.cell(summary.sample([row("a", 1, None, "refused")], "messages")) == "-"


def test_numbers_are_short() -> None:
    for value, text in [(3, "3"), (2.5, "2.50"), (0.01234, "0.0123"), (12345.6, "12,346"), (1e6, "1,000,000")]:
        assert summary.number(value) == text


def test_what_is_drawn_over() -> None:
    given = [row("a", case, 1, tightness=case / 10) for case in (1, 2)]
    assert summary.parameter_to_draw_over(given) == "tightness"
    assert summary.parameter_to_draw_over(given, "problem_seed") == "problem_seed"
    assert summary.parameter_to_draw_over(rows(a=[1, 2])) == "problems"  # only seeds differ
    unseeded = [{name: value for name, value in one.items() if name != "problem_seed"} for one in rows(a=[1, 2])]
    assert summary.parameter_to_draw_over(unseeded) == "team"
    assert summary.parameter_to_draw_over(rows(a=range(13))) == "problems"
    mixed = [{"n": 3, **row("a", 1, 1)}, {"n": 4, **row("a", 2, 1)}, row("a", 3, 1)]
    assert summary.parameter_to_draw_over(mixed) == "team"
    assert summary.values_of([{"x": 3}, {"x": 1}], "x") == [1, 3]
    assert summary.values_of([{"x": "b"}, {"x": "a"}], "x") == ["b", "a"]


def test_parameters_of_runs_are_drawn_over_as_well() -> None:
    given = [row(f"abt delay={delay}" if delay else "abt", delay, 1, delay=delay) for delay in (0, 20)]
    given += [row("dsa cycles=5 variant=A", 3, 1, delay=0, settings={"cycles": 5, "variant": "A"})]
    by_delay = summary.by_parameter(given, summary.parameter_to_draw_over(given, "delay"))
    assert [(one["delay"], one["label"]) for one in by_delay][:2] == [(0, "abt"), (20, "abt")]
    by_cycles = summary.by_parameter(given, summary.parameter_to_draw_over(given, "cycles"))
    assert (by_cycles[2]["cycles"], by_cycles[2]["label"]) == (5, "dsa variant=A")
    assert summary.by_parameter(given, "tightness") is given
    with pytest.raises(summary.NoSuchColumnError, match="there is no parameter 'cycle'"):
        summary.parameter_to_draw_over(given, "cycle")


def test_one_problem_is_drawn_over_what_its_runs_differ_in() -> None:
    given = [row(f"{way} delay={delay}", 1, delay, delay=delay) for way in "ab" for delay in (5, 20)]
    assert summary.parameter_to_draw_over(given) == "delay"
    assert summary.parameter_to_draw_over([row(way, 1, 1, delay=0) for way in "ab"]) == "team"


def test_own_instances_have_a_line_for_all() -> None:
    given = [row(way, case, case, instance=f"p{case}") for way in "ab" for case in (1, 2, 3)]
    given = [{"instance": one["instance"], **{k: v for k, v in one.items() if k != "tightness"}} for one in given]
    assert summary.parameter_to_draw_over(given) == "instance"
    heads, lines = summary.medians(given, "messages", "instance")
    assert lines == [["p1", "1", "1"], ["p2", "2", "2"], ["p3", "3", "3"], ["all", "2", "2"]]
    assert heads == ["instance", "a", "b"]
    assert summary.medians(given[:1], "messages", "instance") == (["instance", "a"], [["p1", "1"]])


def test_how_many_runs_reach_the_best_known_cost() -> None:
    """Problems that are maximised the other way round, and without a solution no cost is reached."""
    given = [
        {**row("dsa", 0, 1), "digest": "a", "cost": 3, "maximises": False, "size": 1},
        {**row("mgm", 0, 1), "digest": "a", "cost": 4, "maximises": False, "size": 1},
        {**row("dsa", 1, 1), "digest": "b", "cost": 3, "maximises": True, "size": 1},
        {**row("mgm", 1, 1), "digest": "b", "cost": 4, "maximises": True, "size": 1},
        {**row("dsa", 2, 1), "digest": "c", "cost": None, "maximises": False, "size": 2},
    ]
    heads, lines = summary.reached(given, "size")
    assert heads == ["size", "dsa", "mgm"]
    assert lines == [["1", "1 of 2", "1 of 2"], ["2", "0 of 1", "-"]]


def test_the_interval_of_a_median() -> None:
    assert statistics.median_interval([7]) == statistics.MedianInterval(7, 7, 7)
    found = statistics.median_interval([float(value) for value in range(101)])
    assert found.median == 50
    # The binomial interval of the median of 101 values, from the 41st to the 61st, is 40 to 60 (Conover 1999).
    assert abs(found.low - 40) <= 3
    assert abs(found.high - 60) <= 3
    assert found == statistics.median_interval([float(value) for value in range(101)])
    with pytest.raises(ValueError, match="no values"):
        statistics.median_interval([])


def test_the_interval_of_a_mean() -> None:
    values = [float(value) for value in range(101)]
    found = statistics.mean_interval(values)
    # The standard error is 29.15 / sqrt(101) = 2.90; the interval is about 1.96 of these on both sides.
    assert found.mean == 50
    assert 43.5 < found.low < 45
    assert 55 < found.high < 56.5
    # Two runs of each problem are as good as one: problems are resampled with all of their runs.
    twice = statistics.mean_interval(values * 2, [str(value) for value in values * 2])
    assert twice.high - twice.low == pytest.approx(found.high - found.low, rel=0.1)
    with pytest.raises(ValueError, match="no values"):
        statistics.mean_interval([])


def test_runs_of_one_problem_are_drawn_together() -> None:
    """Ten runs of each of eleven problems say no more of the problems than one run of each."""
    values = [float(value) for value in range(11)]
    once = statistics.median_interval(values)
    runs = [value for value in values for _ in range(10)]
    often = statistics.median_interval(runs, [str(value) for value in runs])
    assert (often.low, often.high) == (once.low, once.high)
    alone = statistics.median_interval(runs)
    assert alone.high - alone.low < once.high - once.low


@hypothesis.given(st.lists(st.tuples(st.integers(-50, 50), st.integers(0, 5)), min_size=1, max_size=12))
@examples(100)
def test_weighted_medians_are_those_of_the_values_written_out(them: list[tuple[int, int]]) -> None:
    values = sorted(value for value, _ in them)
    counts = [count for _, count in them]
    if any(counts):
        found = statistics.weighted_medians(np.array(values, dtype=float), np.array([counts]))
        assert found == [np.median(np.repeat(values, counts))]


def test_a_problem_counts_once_however_many_runs_there_are() -> None:
    them = [
        row(label, case, case + 10 * (label == "b") + repetition, repetition=repetition)
        for label in "ab" for case in range(8) for repetition in range(1, 6)
    ]  # fmt: skip
    (found,) = statistics.comparisons(them, "messages")
    assert (found.pairs, found.one_better) == (8, 8)
    assert found.p == pytest.approx(2 / 2**8)


def test_a_problem_that_is_seldom_solved_is_in_no_pair() -> None:
    some = [row("a", 0, 5, repetition=n, status="done" if n < 3 else "limit") for n in (1, 2, 3)]
    few = [row("a", 1, 5, repetition=n, status="done" if n == 1 else "limit") for n in (1, 2)]
    (found,) = statistics.comparisons([*some, *few, row("b", 0, 1), row("b", 1, 1)], "messages")
    assert (found.pairs, found.other_better) == (1, 1)


def test_pairs_are_compared_on_what_both_have_solved() -> None:
    given = [
        *rows(a=range(1, 11), b=[value + 10 for value in range(1, 11)]),
        row("a", 99, 1, "limit"),
        row("b", 99, 1),
        row("b", 98, 1),
    ]
    (found,) = statistics.comparisons(given, "messages")
    assert (found.pairs, found.one_better, found.other_better) == (10, 10, 0)
    assert found.p == pytest.approx(2 / 2**10)  # all ten ranks have one sign: exactly one of 2^10 cases on each side
    assert found.ratio == pytest.approx((5 / 15 + 6 / 16) / 2)


def test_tests_are_corrected_for_their_number() -> None:
    """Holm: the smallest probability times their number, the next times one less, and none below those before."""
    given = rows(a=range(1, 11), b=range(11, 21), c=range(21, 31), d=[30 - v for v in range(10)])
    by_pair = {(one.one, one.other): one.p for one in statistics.comparisons(given, "messages")}
    alone = statistics.comparisons(rows(a=range(1, 11), b=range(11, 21)), "messages")[0].p
    assert alone is not None
    assert by_pair["a", "b"] == pytest.approx(6 * alone)
    assert all(p is None or p <= 1 for p in by_pair.values())
    few = statistics.comparisons(rows(a=[1, 2, 3, 4, 5], b=[2, 3, 4, 5, 6]), "messages")
    assert few[0].p is None
    same = statistics.comparisons(rows(a=[5] * 9, b=[5] * 9), "messages")
    assert (same[0].p, same[0].ratio) == (None, 1.0)


def test_profiles_count_what_is_not_solved() -> None:
    given = [*rows(a=[10, 40], b=[20, 10]), row("a", 2, 9, "limit"), row("b", 2, 30)]
    assert statistics.cactus(given, "messages") == {"a": [10.0, 40.0], "b": [10.0, 20.0, 30.0]}
    found = statistics.performance_profile(given, "messages")
    assert [(factor, round(3 * share)) for factor, share in found["a"]] == [(1.0, 1), (4.0, 2)]
    assert [(factor, round(3 * share)) for factor, share in found["b"]] == [(1.0, 1), (1.0, 2), (2.0, 3)]
    free = statistics.performance_profile(rows(a=[0], b=[3]), "messages")
    assert free == {"a": [(1.0, 1.0)], "b": [(math.inf, 1.0)]}


def test_the_cost_over_time_is_that_of_the_last_point_before() -> None:
    curves = [[(2, 0, 0.0, "9"), (6, 0, 0.0, "5")], [(4, 0, 0.0, "7"), (8, 0, 0.0, "1")]]
    given = [row("a", case, 10, cost_over_time=points) for case, points in enumerate(curves)]
    band = statistics.cost_bands(given, "messages")["a"]
    at = {round(spent, 2): median for spent, median in zip(band.spent, band.median, strict=True)}
    assert (band.spent[0], band.spent[-1]) == (4.0, 10.0)
    assert (at[4.0], at[10.0]) == (8.0, 3.0)
    assert next(cost for spent, cost in at.items() if spent > 6) == 6.0
    assert statistics.cost_bands(rows(a=[1]), "messages") == {}


def test_costs_are_drawn_over_cycles_or_simulated_time_where_they_are_counted() -> None:
    curve = [(2, 0, 1.0, "9"), (6, 0, 4.0, "5")]
    given = [row("a", 1, 10, cost_over_time=curve, cycles=8), row("b", 1, 10, cost_over_time=curve, cycles=None)]
    bands = statistics.cost_bands(given, "cycles")
    assert list(bands) == ["a"]
    assert (bands["a"].spent[0], bands["a"].spent[-1], bands["a"].median[-1]) == (1.0, 8.0, 5.0)
    timed = statistics.cost_bands([row("a", 1, 10, cost_over_time=curve, simulated_s=8.5)], "simulated_s")["a"]
    assert (timed.spent[0], timed.spent[-1]) == (1.0, 8.5)
