"""Statistics of one small study, computed by hand: with ties, zeros, and runs that limits have ended.

    problem        1    2    3    4     5      6
    messages of a  0    4    3    6   50+    70+
    messages of b  0    2    0    6     8    90+
    cost of a      0   -2    5    3    9+     7+
    cost of b      2    3    5    1     4     8+

A `+` marks what a run had when a limit ended it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from robochoc.experiments import statistics, summary
from robochoc.experiments.ranking import answers
from robochoc.experiments.report_content import ReportContent
from robochoc.experiments.results import Results
from robochoc.experiments.statistics import Band, Comparison, median_ratio
from robochoc.experiments.summary import without_duplicates
from tests.support.cases import cases

pytest.importorskip("scipy")

MESSAGES = {"a": (0, 4, 3, 6, 50, 70), "b": (0, 2, 0, 6, 8, 90)}
COSTS = {"a": (0, -2, 5, 3, 9, 7), "b": (2, 3, 5, 1, 4, 8)}
OPEN = {("a", 5), ("a", 6), ("b", 6)}


def row(label: str, problem: int, messages: float, cost: float, **more: object) -> dict[str, Any]:
    is_open = (label, problem) in OPEN
    given = {
        "size": problem % 2, "problem_seed": problem, "key": f"{label}{problem}", "problems": "small", "label": label,
        "seed": 0, "repetition": 1, "status": "limit" if is_open else "done",
        "verdict": None if is_open else "solution", "digest": str(problem), "messages": messages, "ncccs": None,
        "bytes": None, "checks": None, "cycles": None, "simulated_s": None, "wall_s": None, "cost": cost,
        "maximises": False, "runtime": "simulator", "settings": {}, "order": "given", "schedule": "concurrent",
        "delay": 0, "withdraw": None, "channel": None, "protocol": label, "team": f"team{problem}",
        "cost_over_time": [], "verified": True, "machine": "", "version": "1",
    }  # fmt: skip
    return {**given, **more}


def study(**more: object) -> list[dict[str, Any]]:
    return [
        row(way, problem, messages, COSTS[way][problem - 1], **more)
        for way, values in MESSAGES.items()
        for problem, messages in enumerate(values, 1)
    ]


def account(rows: list[dict[str, Any]]) -> ReportContent:
    return ReportContent(Results("small", "Small", "", "", len(rows), tuple(rows)), None)


def test_medians() -> None:
    """Of runs that limits have ended: what they had. A median is open if it would be higher without the limits."""
    assert summary.medians(study(), "messages", "size") == (["size", "a", "b"], [["0", "6", "6"], ["1", "3", "0"]])
    assert summary.medians(study(), "cost", "size") == (["size", "a", "b"], [["0", "3", "3"], ["1", "5", "4"]])
    assert summary.medians(study(), "messages", "team")[1][4:6] == [
        ["team5", ">= 50", "8"],
        ["team6", ">= 70", ">= 90"],
    ]
    all_six = [{"instance": f"p{one['digest']}", **one} for one in study()]
    assert summary.medians(all_six, "messages", "instance")[1][-1] == ["all", "5", "4"]


def test_best_of_counts() -> None:
    """Problems 1 and 4 are ties; for costs 3 is."""
    assert answers(study(), ["messages", "cost"]) == [
        "Least messages: b in 5, a in 2 of 5 cases, ties counted for each; 1 open.",
        "Best cost: a in 3, b in 3 of 5 cases, ties counted for each; 1 open.",
    ]


def test_best_of_counts_with_ties_of_all() -> None:
    """A way that is never worse has the best cost in all cases."""
    costs = {"dpop": (1, 0, 2), "mgm": (1, 0, 3), "dsa": (1, 2, 3)}
    rows = [row(way, place, place, cost) for way, given in costs.items() for place, cost in enumerate(given)]
    assert answers(rows, ["cost"]) == ["Best cost: dpop in 3, mgm in 2, dsa in 1 of 3 cases, ties counted for each."]


def test_best_utilities() -> None:
    """Higher is better, and an open run is worse than all others."""
    assert answers(study(maximises=True), ["cost"]) == [
        "Best cost: b in 4, a in 2 of 5 cases, ties counted for each; 1 open."
    ]
    (found,) = statistics.comparisons(study(maximises=True), "cost")
    assert (found.one_better, found.other_better) == (1, 2)


def test_pairs() -> None:
    """Ratios 1, 2, infinite, 1 and differences 0, 2, 3, 0 of messages; differences -2, -5, 0, 2 of costs."""
    assert statistics.comparisons(study(), "messages") == [Comparison("a", "b", 4, 0, 2, 1.5, 1.0, None)]
    assert statistics.comparisons(study(), "cost") == [Comparison("a", "b", 4, 2, 1, None, -1.0, None)]


def test_median_ratios() -> None:
    with cases() as each:
        for pairs, ratio in [
            ([(0, 0)], 1),
            ([(3, 0)], None),
            ([(0, 3)], 0),
            ([(0, 0), (4, 2), (3, 0)], 2),
            ([(1, 2), (3, 0)], None),
            ([(-1, 2)], None),
            ([(2, -1), (1, 1)], None),
            ([], None),
        ]:
            with each(pairs):
                assert median_ratio(pairs) == ratio


def test_the_table_of_pairs() -> None:
    """With six differences of one sign p is 2 of 64; the others are ties, and 0 to 0."""
    rows = [
        row(way, place, messages, 0) for place in range(10, 16) for way, messages in (("a", place), ("b", 2 * place))
    ]
    rows += [row(way, 20, 0, 0) for way in "ab"]
    ((name, (heads, lines)),) = account(rows).pairs()
    assert (name, heads[1:]) == (
        "messages",
        ["problems", "first better", "second better", "median ratio", "median difference", "p"],
    )
    assert lines == [["a / b", "7", "6", "0", "0.50", "-12", "0.031 *"]]


def test_endings_and_solutions() -> None:
    rows = [*study(), row("a", 7, 1, 0, verdict="no-solution"), row("b", 7, 1, 0, verdict="no-solution")]
    assert summary.endings(rows) == (
        ["", "solution", "limit", "no-solution"],
        [["a", "4", "2", "1"], ["b", "5", "1", "1"]],
    )
    assert summary.solved(rows, "problems") == (
        ["problems", "problems", "with a solution", "without"],
        [["small", "7", "5", "1"]],
    )


def test_profiles() -> None:
    assert statistics.cactus(study(), "messages") == {"a": [0, 3, 4, 6], "b": [0, 0, 2, 6, 8]}
    assert statistics.performance_profile(study(), "messages") == {
        "a": [(1, 1 / 6), (1, 2 / 6), (2, 3 / 6), (math.inf, 4 / 6)],
        "b": [(1, 1 / 6), (1, 2 / 6), (1, 3 / 6), (1, 4 / 6), (1, 5 / 6)],
    }


def test_costs_over_messages() -> None:
    """Two runs: 8 from message 1 and 0 from message 3 on; 4 from message 2 on. Both have an assignment from there."""
    curves = [[[1, 0, 0, 8], [3, 0, 0, 0]], [[2, 0, 0, 4]]]
    rows = [row("a", 1, 3, 0, cost_over_time=curves[0]), row("a", 2, 2, 4, cost_over_time=curves[1])]
    band = statistics.cost_bands(rows, "messages")["a"]
    ends = (band.spent[0], band.spent[-1])
    assert (ends, band.low[0], band.median[0], band.high[0]) == ((2, 3), 5, 6, 7)
    assert (band.low[-1], band.median[-1], band.high[-1]) == (1, 2, 3)
    assert isinstance(band, Band)


def test_shares_and_captions() -> None:
    from robochoc.experiments.figures import figures_of  # noqa: PLC0415 - heavy

    drawings = {one.name: one for one in figures_of(study(), "size", ["messages"]).drawings}
    lines = drawings["solved-over-size"].drawn().axes[0].get_lines()
    assert [np.asarray(line.get_ydata()).round(6).tolist() for line in lines[:2]] == [
        [round(2 / 3, 6)] * 2,
        [round(2 / 3, 6), 1.0],
    ]
    (over_teams, *_) = figures_of(study(), "team", ["messages"]).drawings
    assert "A hollow mark is a lower bound" in over_teams.caption


def test_the_sentence_about_runs() -> None:
    assert next(iter(account(study()).measured())) == "12 runs: 6 problems, 2 ways to run."


# Settings with the same problems


def test_settings_with_the_same_problems_count_once() -> None:
    given = [
        {"tightness": tightness, **row(way, seed, messages, 0), "digest": f"{seed}"}
        for tightness in (0.4, 0.5)
        for way, values in MESSAGES.items()
        for seed, messages in enumerate(values[:4], 1)
    ]
    other = [{"tightness": 0.6, **row(way, 9, 9, 0)} for way in "ab"]
    kept, remarks = without_duplicates([*given, *other], ["tightness", "size", "problem_seed"][::2])
    assert kept == [*given[:8], *other]
    assert remarks == [
        "tightness 0.4 and tightness 0.5 generate the same problems: they are counted once, as tightness 0.4."
    ]
    told = account([*given, *other])
    assert next(told.measured()) == "18 runs: 5 problems, 2 ways to run."
    assert remarks[0] in list(told.measured())
    assert told.answers()[0] == "Least messages: b in 5, a in 3 of 5 cases, ties counted for each."


def test_problems_that_are_the_same_by_chance_are_kept() -> None:
    """The same problem for two seeds of one setting, and for one of the seeds of two settings."""
    given = [{"tightness": 0.4, **row("a", seed, 1, 0), "digest": "x"} for seed in (1, 2)]
    given += [{"tightness": 0.5, **row("a", seed, 1, 0), "digest": digest} for seed, digest in ((1, "x"), (2, "y"))]
    assert without_duplicates(given, ["tightness", "problem_seed"]) == (given, [])


def test_problems_without_a_parameter_have_their_name_in_its_place() -> None:
    given = [{"tightness": 0.4, **row("a", 1, 1, 0)}, {**row("a", 2, 2, 0), "problems": "rooms"}]
    assert summary.prepare(given, "tightness", {}).rows[1]["tightness"] == "rooms"
    prepared = summary.prepare(given, "tightness", {})
    assert summary.medians(prepared.rows, "messages", "tightness")[1] == [["0.4", "1"], ["rooms", "2"]]
    assert summary.parameter_to_draw_over(given, "name") == "problems"
