"""Figures of reports: what is drawn, on which axes, and what is left out."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import pytest

from tests.support.cases import cases

if TYPE_CHECKING:
    from robochoc.experiments.figures import Drawing, Figures


def figures_of(rows: list[dict[str, Any]], over: str, metrics: list[str], **more: float) -> Figures:
    """Return the figures of runs. Matplotlib is imported for these tests only."""
    from robochoc.experiments import figures  # noqa: PLC0415 - heavy

    return figures.figures_of(rows, over, metrics, **more)


def row(label: str, problem: int, messages: float | None, status: str = "done", **more: object) -> dict[str, Any]:
    given = {
        "label": label, "seed": 0, "repetition": 1, "status": status, "runtime": "simulator", "settings": {},
        "verdict": "solution" if status == "done" else None, "digest": str(problem), "messages": messages,
        "ncccs": None, "cycles": None, "simulated_s": None, "cost": None, "cost_over_time": [],
    }  # fmt: skip
    return {**given, **more}


def rows(over: str, values: Sequence[Any], ways: Sequence[str], problems: int = 3) -> list[dict[str, Any]]:
    """Return runs of different needs: `problems` at each of the values of the parameter `over`."""
    return [
        row(way, 100 * at + case, 10 + 7 * place + 3 * at + 5 * case, **{over: value})
        for at, value in enumerate(values)
        for case in range(problems)
        for place, way in enumerate(ways)
    ]


def by_name(figures: Figures) -> dict[str, Drawing]:
    return {one.name: one for one in figures.drawings}


def axes_of(drawing: Drawing) -> Any:  # noqa: ANN401 - matplotlib's
    return drawing.drawn().axes[0]


def drawn(drawing: Drawing) -> Any:  # noqa: ANN401 - matplotlib's
    figure = drawing.drawn()
    figure.draw_without_rendering()
    return figure


@pytest.fixture(scope="module", autouse=True)
def _fonts() -> None:
    """Draw once: fonts that matplotlib has opened stay open."""
    pytest.importorskip("matplotlib")
    drawn(figures_of(rows("n", [1, 2], ["a", "b"]), "n", ["messages"]).drawings[0])


def ticks(axes: Any) -> list[str]:  # noqa: ANN401 - matplotlib's
    low, high = axes.get_xlim()
    return [one.get_text() for one in axes.get_xticklabels() if low <= one.get_position()[0] <= high]


def test_kinds_of_problems_lie_side_by_side_in_natural_order() -> None:
    given = rows("instance", [f"p{number}" for number in (1, 10, 11, 2)], ["a", "b", "c"])
    axes = axes_of(by_name(figures_of(given, "instance", ["messages"]))["messages-over-instance"])
    assert ticks(axes) == ["p1", "p2", "p10", "p11"]
    marks = [float(line.get_xdata()[0]) for line in axes.get_lines()]
    assert all(len(line.get_xdata()) == 1 for line in axes.get_lines())
    assert len(set(marks)) == 12
    assert [[round(mark) for mark in marks].count(place) for place in range(4)] == [3, 3, 3, 3]


def test_names_below_the_axis_are_short_and_apart() -> None:
    for names, shown, what in [
        ([f"warehouse-problem-{n}" for n in range(1, 7)], [str(n) for n in range(1, 7)], "(warehouse-problem-…)"),
        (["sparse", "dense"], ["sparse", "dense"], "problems"),
        (["a long name of problems", "colouring", "meetings"], ["a long na…problems", "colouring", "meetings"], ""),
        ([f"{n} very long names of problems" for n in range(12)], [f"{n} very lo…problems" for n in range(10)], ""),
    ]:
        figure = drawn(
            by_name(figures_of(rows("problems", names, ["a", "b"]), "problems", ["messages"]))["messages-over-problems"]
        )
        axes = figure.axes[0]
        assert [len(text) <= 18 for text in ticks(axes)] == [True] * len(names)
        assert ticks(axes)[: len(shown)] == shown
        assert what in axes.get_xlabel()
        labels = [one for one in axes.get_xticklabels() if one.get_text()]
        if labels[0].get_rotation() == 0:
            boxes = [one.get_window_extent() for one in labels]
            assert all(one.x1 <= other.x0 for one, other in itertools.pairwise(boxes))


def test_over_many_problems_nothing_is_drawn_but_profiles() -> None:
    given = rows("instance", [f"p{number}" for number in range(13)], ["a", "b"])
    figures = figures_of(given, "instance", ["messages"])
    assert list(by_name(figures)) == ["cactus-messages", "profile-messages", "messages-a-b"]
    assert "There are 13 values of instance: tables list them, and no figures are drawn over them." in figures.remarks


def test_many_ways_to_run_are_told_apart() -> None:
    """Any two differ in two of colour, marker and dashes: in grey, too, and where marks or dashes are not seen."""
    from robochoc.experiments.axes import MOST_WAYS, styles_of  # noqa: PLC0415 - heavy

    ways = [f"way {number}" for number in range(MOST_WAYS + 3)]
    styles = list(styles_of(ways).values())
    assert len(styles) == MOST_WAYS >= 24
    for parts in itertools.combinations(range(3), 2):
        assert len({tuple(style[part] for part in parts) for style in styles}) == MOST_WAYS
    figures = figures_of(rows("n", [1, 2], ways), "n", ["messages"])
    assert f"Figures show the first {MOST_WAYS} of {len(ways)} ways to run; tables show all." in figures.remarks
    assert len(axes_of(figures.drawings[0]).figure.legends[0].get_texts()) == MOST_WAYS


@pytest.mark.parametrize("count", [2, 12])
def test_legends_cover_nothing(count: int) -> None:
    ways = [f"protocol-{number} order=max-degree" for number in range(count)]
    for drawing in figures_of(rows("n", [1, 2, 3], ways), "n", ["messages"], width=3.4).drawings[:2]:
        figure = drawn(drawing)
        legend, axes = figure.legends[0].get_window_extent(), figure.axes[0].get_window_extent()
        assert legend.y0 >= axes.y1
        assert legend.x0 >= 0
        assert legend.x1 <= figure.bbox.width
        assert axes.height > 0.4 * axes.width


def test_profiles_go_on_to_the_right_edge() -> None:
    given = [
        *(row("a", case, 10) for case in range(8)),
        *(row("b", case, 10 * 2**case) for case in range(4)),
        *(row("b", case, 1000, "limit") for case in range(4, 8)),
    ]
    figures = by_name(figures_of(given, "n", ["messages"]))
    for name, ends in {"profile-messages": [1.0, 0.5], "cactus-messages": [8, 4]}.items():
        axes = axes_of(figures[name])
        assert [line.get_ydata()[-1] for line in axes.get_lines()] == ends
        assert {line.get_xdata()[-1] for line in axes.get_lines()} == {axes.get_xlim()[1]}
        assert "Runs that limits have ended are not solved." in figures[name].caption
    assert [text for text in ticks(drawn(figures["profile-messages"]).axes[0]) if text] == ["1", "2", "5"]


TICKS: list[tuple[Sequence[float], str, list[str]]] = [
    ([0, 10, 100, 1000], "symlog", ["0", "10", "100", "1,000"]),
    ([1, 10, 100, 1000], "log", ["1", "10", "100", "1,000"]),
    ([1, 2, 4, 8, 16, 32], "log", ["1", "2", "4", "8", "16", "32"]),
    ([0, 20, 50, 100], "linear", ["0", "20", "50", "100"]),
    ([5, 10, 20], "linear", ["5", "10", "20"]),
    ([0.2, 0.30000000000000004, 0.4], "linear", ["0.2", "0.3", "0.4"]),
    (list(range(1, 41)), "linear", [str(value) for value in range(1, 41, 3)]),
    ([-5, 0, 500], "linear", ["-5", "500"]),
]


def test_ticks_are_at_the_values_that_were_run() -> None:
    with cases() as each:
        for values, scale, shown in TICKS:
            with each(values):
                given = rows("n", values, ["a", "b"], problems=1)
                axes = axes_of(by_name(figures_of(given, "n", ["messages"]))["messages-over-n"])
                assert axes.get_xscale() == scale
                assert ticks(axes) == shown
                assert not len(axes.xaxis.get_minorticklocs())


def test_what_says_nothing_is_left_out() -> None:
    given = [row(way, 10 * n + case, 1000 * n + case, n=n) for way in "ab" for n in (1, 2) for case in range(3)]
    figures = figures_of(given, "n", ["messages"])
    assert list(by_name(figures)) == ["messages-over-n"]
    need, at = "the same number of messages", " at the same value of n"
    assert figures.remarks == [
        "Every run has a verdict.",
        f"Each way to run needs {need} in all of its runs{at}, within 1 %: no profiles of them are drawn.",
        f"a and b need {need} for all problems that both have solved.",
    ]
    assert "Identical lines: a and b." in figures.drawings[0].caption
    some = [{**one, "verdict": "no-solution"} if one["n"] > 1 else one for one in given]
    assert list(by_name(figures_of(some, "n", ["messages"]))) == ["messages-over-n", "solutions-over-n"]
    cut = [*given, row("b", 99, 1, "limit", n=1)]
    figures = figures_of(cut, "n", ["messages"])
    assert "solved-over-n" in by_name(figures)
    assert "Every run has a verdict." not in figures.remarks


def test_ways_with_the_same_values_are_both_seen() -> None:
    given = [{**one, "label": way} for one in rows("n", [1, 2], ["a"]) for way in "abc"]
    given += rows("n", [1, 2], ["d", "e"])
    figures = by_name(figures_of(given, "n", ["messages"]))
    for name in ("messages-over-n", "cactus-messages"):
        lines = [line for line in axes_of(figures[name]).get_lines() if len(line.get_xdata()) > 1]
        widths = [line.get_linewidth() for line in lines]
        assert widths[0] > widths[1] > widths[2]
        assert "Identical lines: a, b, c and d." in figures[name].caption
    assert "messages-a-b" not in figures
    assert "messages-a-e" in figures


def test_costs_come_first_where_they_differ() -> None:
    curve = [(2, 3, 1.0, "9"), (6, 5, 4.0, "5")]
    more: dict[str, Any] = {"cost_over_time": curve, "cycles": 8, "ncccs": 9}
    given = [
        row(way, case, 10 + case, n=case % 2, cost=case + place, **more)
        for place, way in enumerate("ab")
        for case in range(6)
    ]
    names = list(by_name(figures_of(given, "n", ["messages", "cost"])))
    assert names[:5] == ["cost-over-cycles", "cost-over-messages", "cost-over-ncccs", "final-costs", "messages-over-n"]
    groups = axes_of(by_name(figures_of(given, "n", ["messages", "cost"]))["final-costs"])
    assert ticks(groups) == ["0", "1"]
    alone = axes_of(
        by_name(figures_of([{**one, "team": one["digest"]} for one in given], "team", ["cost"]))["final-costs"]
    )
    assert ticks(alone) == ["a", "b"]
    assert len(groups.get_lines()) == 2 * len(alone.get_lines())
    optimal = [{**one, "cost": 5} for one in given]
    names = list(by_name(figures_of(optimal, "n", ["messages", "cost"])))
    assert (names[0], names[-3:]) == ("messages-over-n", ["cost-over-cycles", "cost-over-messages", "cost-over-ncccs"])


def test_hollow_marks_and_ways_without_a_value_are_told_of() -> None:
    given = [row("a", case, 7 + case, n=case % 2) for case in range(4)]
    given += [row("b", case, 9 + case, "limit", n=case % 2) for case in range(4)]
    given += [row("c", case, None, "refused", n=case % 2) for case in range(4)]
    drawing = figures_of(given, "n", ["messages"]).drawings[0]
    assert "A hollow mark is a lower bound" in drawing.caption
    assert drawing.caption.endswith("Without a value: c.")
    faces = [line.get_markerfacecolor() for line in axes_of(drawing).get_lines() if len(line.get_xdata()) == 1]
    assert [face == "white" for face in faces] == [False, False, True, True]


def test_figures_have_the_width_that_is_asked_for() -> None:
    for drawing in figures_of(rows("n", [1, 2], ["a", "b"]), "n", ["messages"], width=3.4).drawings:
        assert drawing.drawn().get_figwidth() == 3.4


def test_a_need_of_nothing_is_drawn_as_well() -> None:
    """Zeros have no place on a logarithmic axis: there it is linear up to the smallest value."""
    given = [row(way, case, value, n=case % 2) for way in "ab" for case, value in enumerate([0, 5, 100, 4000])]
    given[0]["messages"] = 3
    figures = by_name(figures_of(given, "n", ["messages"]))
    assert axes_of(figures["cactus-messages"]).get_xscale() == "symlog"
    assert axes_of(figures["messages-a-b"]).get_yscale() == "symlog"
    assert drawn(figures["cactus-messages"])


def test_a_problem_counts_at_each_value_of_a_parameter_of_runs() -> None:
    given = [
        row(w, case, 5 + case + at, delay=at, case=at) for w, at in itertools.product("ab", (0, 9)) for case in range(3)
    ]
    given[0]["messages"] = 1
    figures = by_name(figures_of(given, "delay", ["messages"]))
    assert "A problem counts at each value of delay." in figures["cactus-messages"].caption
    assert axes_of(figures["cactus-messages"]).get_lines()[0].get_ydata()[-1] == 6
    assert len(axes_of(figures["messages-a-b"]).collections[0].get_offsets()) == 6


def test_labels_are_written_as_they_are() -> None:
    ways = ["$\\foo$", "a$b$ \\$", "$"]
    figure = drawn(figures_of(rows("k$i$nd", ["$\\bar$", "b"], ways), "k$i$nd", ["messages"]).drawings[0])
    axes = figure.axes[0]
    texts = [axes.xaxis.label, *axes.get_xticklabels(), *figure.legends[0].get_texts()]
    names = ["k$i$nd", "$\\bar$", "b", *ways]
    assert [one.get_text() for one in texts] == [name.replace("$", r"\$") for name in names]


def test_names_of_files_are_told_apart() -> None:
    from robochoc.experiments.figures import unique_names  # noqa: PLC0415 - heavy

    assert unique_names(["a", "b", "a", "a-2", "a"]) == ["a", "b", "a-2", "a-2-2", "a-3"]
