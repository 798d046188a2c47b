"""The pictures in `plots/`, drawn from `data/*.csv`: `python benchmarks/plots.py` draws them again without running.

The only file that needs matplotlib: `pip install -e '.[bench]'`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import mean, median
from typing import NamedTuple

import dynamic
import local_search
import matplotlib as mpl
import optimum
import sweep
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rows import read_rows

FOLDER = Path(__file__).with_name("plots")
GREY = "#8a8a8a"
GAP = 0.045
"""Between two labels, as a share of the height."""


Key = tuple[str, float, int, str]
"""Kind, tightness, rate and protocol."""


class Style(NamedTuple):
    """How a line looks. The colours are those of Okabe and Ito, which the colour-blind can tell apart."""

    colour: str
    dashes: str = "-"
    marker: str = "o"
    width: float = 1.5


STYLES = {
    "abt": Style("#000000"),
    "abt-do-retro": Style("#56b4e9", marker="s"),
    "agile-abt": Style("#0072b2", marker="^"),
    "afc": Style("#cc79a7", marker="D"),
    "afc-tree": Style("#e69f00", marker="s", width=3.5),
    "afc-tree dfs": Style("#b07800", "--", "^"),
    "afc-ng": Style("#d55e00"),
    "awc": Style("#009e73", marker="D"),
    "disfc": Style(GREY, marker="s"),
    "sbt": Style(GREY, "--", "v"),
}
LOCAL_STYLES = {
    "dsa A": Style("#56b4e9", marker="s"),
    "dsa B": Style("#0072b2"),
    "dsa C": Style("#0072b2", "--", "D"),
    "mgm": Style("#000000", marker="^"),
    "mgm2": Style("#e69f00", marker="s"),
    "maxsum": Style("#d55e00", marker="D"),
}
SERIES_STYLES = (
    Style("#56b4e9"),
    Style("#0072b2", marker="s"),
    Style("#000000", marker="^"),
    Style("#d55e00", "--", "D"),
    Style("#009e73", "--", "v"),
)


class Line(NamedTuple):
    """Points in a picture, from left to right, and what stands beside the last one. `open_at` are lower bounds."""

    label: str
    style: Style
    x: Sequence[float]
    y: Sequence[float]
    open_at: Sequence[int] = ()


def draw_sweep() -> None:
    """NCCCs, and messages, over tightness: sparse and dense problems side by side."""
    points = read_rows(sweep.DATA, sweep.Point)
    panels = {
        "sparse": "sparse: 20 robots, 10 values, density 0.2",
        "dense": "dense: 15 robots, 5 values, density 0.7",
    }
    for metric, what in (("ncccs", "non-concurrent constraint checks"), ("messages", "messages")):
        figure, places = plt.subplots(1, 2, figsize=(12, 5.2), sharey=True, width_ratios=(3, 2))
        drawn = []
        for axes, (series, title) in zip(places, panels.items(), strict=True):
            here = [point for point in points if point.series == series]
            drawn.append([line for label in STYLES for line in _over_tightness(label, metric, here)])
            _lines(axes, drawn[-1])
            axes.set(xlabel="tightness (dotted: half of the problems are soluble)", title=title)
            _mark_half(axes, here)
        places[0].set_ylabel(f"{what}, median (open triangles: at least)")
        for axes, lines in zip(places, drawn, strict=True):
            _name(axes, lines)
        _save(figure, f"sweep-{metric}")


def _over_tightness(label: str, metric: str, points: Iterable[sweep.Point]) -> Iterable[Line]:
    mine = sorted((point for point in points if point.label == label), key=lambda point: point.tightness)
    if mine:
        heights = [max(1.0, getattr(point, f"{metric}_median")) for point in mine]
        bounds = [place for place, point in enumerate(mine) if point.censored * 2 >= point.problems]
        yield Line(label, STYLES[label], [point.tightness for point in mine], heights, bounds)


def _mark_half(axes: Axes, points: Iterable[sweep.Point]) -> None:
    """A mark where the share of problems with a solution goes through one half."""
    shares = sorted((one.tightness, one.soluble / one.problems) for one in points if one.label == "abt")
    for (left, high), (right, low) in pairwise(shares):
        if high >= 0.5 > low:
            where = left + (right - left) * (high - 0.5) / (high - low)
            axes.axvline(where, color=GREY, linewidth=0.8, linestyle=":", zorder=0)


def draw_dynamic() -> None:
    """What DynABT needs as a share of what others need that begin anew, over the rate of changes."""
    points = {(one.kind, one.tightness, one.rate, one.protocol): one for one in read_rows(dynamic.DATA, dynamic.Point)}
    figure, places = plt.subplots(2, 2, figsize=(11, 8), sharex=True, sharey="row")
    for row, other in zip(places, dynamic.PROTOCOLS[1:], strict=True):
        for axes, metric in zip(row, ("messages", "ncccs"), strict=True):
            lines = [_over_rates(place, points, other, metric) for place in range(len(dynamic.SERIES))]
            _lines(axes, lines)
            axes.axhline(1, color=GREY, linewidth=0.8, zorder=0)
            axes.set(xscale="log", yscale="log", title=f"{'NCCCs' if metric == 'ncccs' else metric}, DynABT / {other}")
            axes.set_xticks(dynamic.RATES, [f"{rate} %" for rate in dynamic.RATES], minor=False)
            axes.minorticks_off()
            ticks = (0.02, 0.05, 0.1, 0.2, 0.5, 1, 2)
            axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
            axes.set_ylim(0.02, 3)
            _name(axes, lines)
    for axes in places[-1]:
        axes.set_xlabel("constraints changed by each event")
    _save(figure, "dynamic")


def _over_rates(
    place: int, points: Mapping[tuple[str, float, int, str], dynamic.Point], other: str, metric: str
) -> Line:
    series = dynamic.SERIES[place]
    heights = []
    for rate in dynamic.RATES:
        ours, theirs = (points[(*series, rate, name)] for name in (dynamic.PROTOCOLS[0], other))
        heights.append(getattr(ours, f"{metric}_mean") / getattr(theirs, f"{metric}_mean"))
    return Line(f"{series.kind}, {series.tightness:g}", SERIES_STYLES[place], list(dynamic.RATES), heights)


def draw_optimum() -> None:
    """What each protocol that minimises needs: a dot a problem, a bar the median; a row of panels a density."""
    runs = read_rows(optimum.DATA, optimum.Run)
    titles = {"messages": "messages", "ncccs": "NCCCs", "bytes": "bytes", "cpu_s": "CPU seconds, simulator"}
    names = optimum.PROTOCOLS[::-1]
    figure, places = plt.subplots(len(optimum.DENSITIES), len(titles), figsize=(13, 5.4), sharex="col", sharey=True)
    for row, density in zip(places, optimum.DENSITIES, strict=True):
        for axes, (metric, title) in zip(row, titles.items(), strict=True):
            for height, name in enumerate(names):
                mine = [run for run in runs if run.density == density and run.protocol == name]
                _dots(axes, height, [getattr(run, metric) for run in mine], [run.verdict != "unknown" for run in mine])
            axes.set(xscale="log", title=f"{title}, density {density:g}")
            axes.set_yticks(range(len(names)), names)
            axes.spines[["top", "right"]].set_visible(False)
            axes.grid(axis="x", color="#e6e6e6", linewidth=0.7)
            axes.set_axisbelow(True)
    _save(figure, "optimum")


def _dots(axes: Axes, height: int, values: Sequence[float], ended: Sequence[bool]) -> None:
    """One protocol's runs, those that were broken off as open triangles, and their median."""
    for mark, face, chosen in (("o", "#0072b2", True), (">", "white", False)):
        here = [value for value, end in zip(values, ended, strict=True) if end is chosen]
        axes.scatter(here, [height] * len(here), s=14, marker=mark, facecolor=face, edgecolor="#0072b2", alpha=0.7)
    axes.plot([median(values)] * 2, [height - 0.3, height + 0.3], color="#d55e00", linewidth=2)


def draw_local_search() -> None:
    """The cost over the cycles: one panel a degree."""
    points = read_rows(local_search.DATA, local_search.Point)
    figure, places = plt.subplots(1, len(local_search.DEGREES), figsize=(12, 5), sharey=True)
    drawn = [[_over_cycles(label, degree, points) for label in LOCAL_STYLES] for degree in local_search.DEGREES]
    for axes, degree, lines in zip(places, local_search.DEGREES, drawn, strict=True):
        _lines(axes, lines)
        ticks = [cycle for cycle in local_search.SHOWN if cycle in {1, 2, 3, 5, 10, 20, 50, 100}]
        axes.set(xscale="log", xlabel="cycle", title=f"1,000 robots, 3 colours, average degree {degree}")
        axes.set_xticks(ticks, [str(tick) for tick in ticks], minor=False)
        axes.minorticks_off()
    places[0].set_ylabel("conflicts, mean")
    for axes, lines in zip(places, drawn, strict=True):
        _name(axes, lines)
    _save(figure, "local-search")


def _over_cycles(label: str, degree: int, points: Iterable[local_search.Point]) -> Line:
    mine = sorted((one.cycle, one.cost_mean) for one in points if (one.degree, one.label) == (degree, label))
    cycles, costs = zip(*(one for one in mine if one[0]), strict=True)
    return Line(label, LOCAL_STYLES[label], cycles, costs)


# Lines with their labels


def _lines(axes: Axes, lines: Sequence[Line]) -> None:
    """Draw `lines`."""
    for line in lines:
        colour, dashes, marker, width = line.style
        axes.plot(line.x, line.y, linestyle=dashes, color=colour, marker=marker, markersize=4, linewidth=width)
        xs, ys = ([values[place] for place in line.open_at] for values in (line.x, line.y))
        axes.plot(xs, ys, color="white", markeredgecolor=colour, marker="^", markersize=9, linestyle="")
    axes.set_yscale("log")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="#e6e6e6", linewidth=0.7)
    axes.set_axisbelow(True)


def _name(axes: Axes, lines: Sequence[Line]) -> None:
    """Names on the right, in the order of the lines' ends and apart from each other, each tied to its end."""
    shares = axes.transAxes.inverted()
    heights = [shares.transform(axes.transData.transform((line.x[-1], line.y[-1])))[1] for line in lines]
    order = sorted(range(len(lines)), key=heights.__getitem__)
    for place, height in zip(order, _apart([heights[place] for place in order]), strict=True):
        line = lines[place]
        axes.annotate(
            line.label,
            xy=(line.x[-1], line.y[-1]),
            xytext=(1.05, height),
            textcoords="axes fraction",
            color=line.style.colour,
            fontsize=9,
            va="center",
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": line.style.colour, "linewidth": 0.6, "shrinkA": 1, "shrinkB": 4},
        )


def _apart(heights: Sequence[float]) -> list[float]:
    """`heights`, which ascend, moved as little as need be to be `GAP` apart: those too close share their mean."""
    groups: list[list[float]] = []
    for place, height in enumerate(heights):
        groups.append([height - place * GAP])
        while len(groups) > 1 and mean(groups[-2]) >= mean(groups[-1]):
            last = groups.pop()
            groups[-1] += last
    levels = [mean(group) for group in groups for _ in group]
    return [level + place * GAP for place, level in enumerate(levels)]


def _save(figure: Figure, name: str) -> None:
    """Write a picture, the same bytes for the same data."""
    FOLDER.mkdir(exist_ok=True)
    figure.tight_layout()
    figure.savefig(FOLDER / f"{name}.svg", metadata={"Date": None})
    plt.close(figure)


DRAWN: dict[str, Callable[[], None]] = {
    "sweep": draw_sweep,
    "dynamic": draw_dynamic,
    "optimum": draw_optimum,
    "local_search": draw_local_search,
}

mpl.use("svg")
mpl.rcParams.update({"svg.hashsalt": "robochoc", "svg.fonttype": "none", "path.simplify": True})

if __name__ == "__main__":
    for part in DRAWN.values():
        part()
