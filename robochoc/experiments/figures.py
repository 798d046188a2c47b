"""Selects the figures of a report, and writes their titles and captions."""

from __future__ import annotations

import io
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robochoc.experiments import plots, statistics, summary
from robochoc.experiments.axes import MOST_WAYS, Style, numbers, plain_ticks, styles_of
from robochoc.experiments.plots import Spot, same_lines
from robochoc.experiments.statistics import Case
from robochoc.experiments.study import WIDTH
from robochoc.experiments.summary import METRICS, Rows
from robochoc.experiments.task import Status
from robochoc.model.outcome import Verdict
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import listed

_SETTINGS = {
    "font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.alpha": 0.25,
    "legend.frameon": False, "legend.fontsize": 8, "svg.hashsalt": "robochoc",
    "pdf.fonttype": 42, "lines.linewidth": 1.4, "lines.markersize": 4.5, "figure.constrained_layout.use": True,
}  # fmt: skip
_HEIGHT = 0.64
"""The height of a figure as a share of its width, without the legend."""
_NARROW, _SMALL = 4, {"font.size": 8, "legend.fontsize": 7, "lines.markersize": 4}
"""Figures narrower than this width in inches have smaller letters."""
MOST_KINDS = 12
"""The most kinds of problems, or instances, on the axis of a figure: more names would not be readable."""
MOST_PROFILES, MOST_PAIRS = 2, 4
"""The most metrics with profiles, and the most pairs of ways to run with scatter plots."""
MOST_BOXES = 40
"""The most boxes side by side in one plot."""
_NEARLY = 1.01
"""Values count as equal if they differ by at most this factor (1 %)."""


@dataclass(frozen=True)
class Drawing:
    """A figure: its file name, title, caption, drawing function, and width in inches."""

    name: str
    title: str
    caption: str
    draw: Callable[[Axes], None]
    width: float = WIDTH

    def __post_init__(self) -> None:
        """Make the name valid as a file name, since it contains parameter names from a study's file."""
        object.__setattr__(self, "name", _file(self.name))

    def svg(self, *, text: bool = False) -> bytes:
        """Return the figure as SVG. If `text` is true, words are text in the reader's font, instead of shapes."""
        return self._saved("svg", {"Date": None}, {"svg.fonttype": "none" if text else "path"})

    def pdf(self) -> bytes:
        """Return the figure as PDF."""
        return self._saved("pdf", {"CreationDate": None}, {})

    def drawn(self) -> Figure:
        """Return the figure with its axes."""
        with mpl.rc_context({**_SETTINGS, **(_SMALL if self.width < _NARROW else {})}):
            figure = Figure(figsize=(self.width, _HEIGHT * self.width))
            axes = figure.add_subplot()
            self.draw(axes)
            plain_ticks(axes)
        return figure

    def _saved(self, form: str, metadata: dict[str, None], settings: dict[str, str]) -> bytes:
        out = io.BytesIO()
        with mpl.rc_context({**_SETTINGS, **settings}):
            self.drawn().savefig(out, format=form, metadata=metadata)
        return out.getvalue()


class Figures(NamedTuple):
    """The informative figures for some results, and a sentence for each figure that is left out."""

    drawings: list[Drawing]
    remarks: list[str]


@dataclass(frozen=True)
class _Shown:
    """The rows shown in figures over one parameter: the results of the ways to run that have a style."""

    rows: Rows
    over: str
    styles: Mapping[str, Style]

    @property
    def values(self) -> list[Any]:
        return summary.values_of(self.rows, self.over)

    @property
    def grouped(self) -> bool:
        """True if the parameter has several values, but fewer than there are problems."""
        return 1 < len(self.values) < len({(row.get("case"), row["digest"]) for row in self.rows})

    @cached_property
    def value_at(self) -> dict[str, Any]:
        """The value of the parameter for each problem; None for all problems if they are not grouped by it."""
        grouped = self.grouped
        return {row["digest"]: row.get(self.over) if grouped else None for row in self.rows}


def figures_of(rows: Rows, over: str, metrics: Sequence[str], width: float = WIDTH) -> Figures:
    """Return the informative figures of the results, each `width` inches wide."""
    styles = styles_of(summary.labels(rows))
    shown = _Shown([row for row in rows if str(row["label"]) in styles], over, styles)
    found = list(_all(shown, metrics))
    if len(summary.labels(rows)) > MOST_WAYS:
        found.append(f"Figures show the first {MOST_WAYS} of {len(summary.labels(rows))} ways to run; tables show all.")
    drawings = [Drawing(one.name, one.title, one.caption, one.draw, width) for one in found if isinstance(one, Drawing)]
    return Figures(drawings, [one for one in found if isinstance(one, str)])


def _all(shown: _Shown, metrics: Sequence[str]) -> Iterator[Drawing | str]:
    """Yield figures, or a sentence instead of an uninformative figure. If costs differ, their figures are first."""
    local = _costs_differ(shown.rows)
    if local:
        yield from _costs(shown, metrics)
    yield from _over_parameter(shown, metrics)
    yield from _profiles(shown, [one for one in metrics if one in summary.CENSORED][:MOST_PROFILES])
    if not local:
        yield from _costs(shown, ())


def _over_parameter(shown: _Shown, metrics: Sequence[str]) -> Iterator[Drawing | str]:
    over, values = shown.over, shown.values
    if len(values) == 1:
        return
    if not numbers(values) and len(values) > MOST_KINDS:
        yield f"There are {len(values):,} values of {over}: tables list them, and no figures are drawn over them."
        return
    for metric in metrics:
        name, spots = METRICS[metric], _spots(shown, metric)
        some = [value for value in values if any(spot.at == value for line in spots.values() for spot in line)]
        if some and metric != over:
            draw = partial(plots.over_parameter, spots, some, (over, name), shown.styles)
            yield Drawing(f"{metric}-over-{over}", f"{name} over {over}", _caption(spots, values, name), draw)
    yield from _solved(shown)


def _spots(shown: _Shown, metric: str) -> dict[str, list[Spot]]:
    found = summary.samples(shown.rows, metric, shown.over)
    spots: dict[str, list[Spot]] = {way: [] for way in shown.styles}
    for way, line in spots.items():
        for value in shown.values:
            one = found.get((value, way))
            if one and one.values:
                band = statistics.median_interval(one.values, one.problems)
                line.append(Spot(value, band.median, band.low, band.high, one.open_ended))
    return spots


def _caption(spots: Mapping[str, Sequence[Spot]], values: Sequence[Any], name: str) -> str:
    """Return the caption for a figure of medians over a parameter."""
    drawn = [spot for line in spots.values() for spot in line]
    caption = f"Median of {name}"
    caption += ", with its 95 % confidence interval (bootstrap)." if any(s.low < s.high for s in drawn) else "."
    if any(spot.open_ended for spot in drawn):
        caption += " A hollow mark is a lower bound, as limits have ended runs."
    lines = {way: tuple((spot.at, spot.median) for spot in line) for way, line in spots.items() if line}
    return caption + (_same(lines) if numbers(values) else "") + _missing(spots)


def _same(lines: Mapping[str, Any]) -> str:
    """Return a sentence about identical lines."""
    groups = [listed(group) for group in same_lines(lines)]
    return f" Identical lines: {'; '.join(groups)}." if groups else ""


def _missing(lines: Mapping[str, Sequence[Any]]) -> str:
    """Return a sentence about the ways to run that have no line."""
    missing = [way for way, line in lines.items() if not line]
    return f" Without a value: {', '.join(missing)}." if missing else ""


def _solved(shown: _Shown) -> Iterator[Drawing | str]:
    rows, over, values = shown.rows, shown.over, shown.values
    found = {
        way: [_share([row for row in rows if row.get(over) == value and row["label"] == way]) for value in values]
        for way in shown.styles
    }
    solutions = [_solutions([row for row in rows if row.get(over) == value]) for value in values]
    if all(share == 1 or math.isnan(share) for line in found.values() for share in line):
        yield "Every run has a verdict."
        found = {}
    if found:
        same = _same(_lines(found)) if numbers(values) else ""
        caption = f"Share of runs with a verdict, and, shaded, that of problems with a solution.{same}"
        draw = partial(plots.shares, found, values, solutions, (over, "share of runs"), shown.styles)
        yield Drawing(f"solved-over-{over}", f"Solved, over {over}", caption, draw)
    elif len(set(solutions)) > 1 and len({row["digest"] for row in rows}) > len(values):
        caption = "Share of problems with a solution."
        draw = partial(plots.shares, {}, values, solutions, (over, "share of problems"), shown.styles)
        yield Drawing(f"solutions-over-{over}", f"Problems with a solution, over {over}", caption, draw)


def _lines(found: Mapping[str, Sequence[Any]]) -> dict[str, tuple[Any, ...]]:
    return {way: tuple(line) for way, line in found.items()}


def _share(rows: Rows) -> float:
    return sum(row["status"] == Status.DONE for row in rows) / len(rows) if rows else math.nan


def _solutions(rows: Rows) -> float:
    """Return the share of problems with a solution among the problems that any way to run has solved."""
    solved = {row["digest"]: row["verdict"] != Verdict.NO_SOLUTION for row in rows if row["status"] == Status.DONE}
    return sum(solved.values()) / len(solved) if solved else math.nan


def _profiles(shown: _Shown, metrics: Sequence[str]) -> Iterator[Drawing | str]:
    """Yield profiles and scatter plots for some metrics, and sentences about ways to run with equal results."""
    if len(shown.styles) == 1:
        return
    needs = {
        metric: {way: statistics.by_problem(shown.rows, way, metric) for way in shown.styles} for metric in metrics
    }
    for metric, found in needs.items():
        if any(_vary(shown, cases) for cases in found.values()):
            yield from _profile(shown, metric)
            yield from _scatters(shown, metric, found)
        elif any(found.values()):
            at = f" at the same value of {shown.over}" if shown.grouped else ""
            need = f"the same number of {METRICS[metric]} in all of its runs{at}, within 1 %"
            yield f"Each way to run needs {need}: no profiles of them are drawn."
    first, *others = shown.styles
    for way in others:
        same = [metric for metric, found in needs.items() if _the_same(_pairs(found, first, way))]
        if same:
            what = listed(METRICS[one] for one in same)
            yield f"{first} and {way} need the same number of {what} for all problems that both have solved."


def _profile(shown: _Shown, metric: str) -> Iterator[Drawing]:
    """Yield a cactus plot and a performance profile, each unless all ways to run have the same line."""
    name, found = METRICS[metric], statistics.cactus(shown.rows, metric)
    solved = {way: line for way, line in found.items() if line}
    cut = " Runs that limits have ended are not solved." if _some_cut(shown.rows) else ""
    if any("case" in row for row in shown.rows):
        cut += f" A problem counts at each value of {shown.over}."
    lines = _lines(found)
    if len(set(lines.values())) > 1:
        caption = (
            f"The number of problems solved within a number of {name} each: a cactus plot, its axes exchanged.{cut}"
        )
        caption += _same(_lines(solved)) + _missing(found)
        draw = partial(plots.cactus, solved, name, shown.styles)
        yield Drawing(f"cactus-{metric}", f"Solved within {name}", caption, draw)
    points = {way: line for way, line in statistics.performance_profile(shown.rows, metric).items() if line}
    factors = {way: [factor for factor, _ in line if math.isfinite(factor)] for way, line in points.items()}
    if len(set(_lines(factors).values())) > 1:
        each = min(share for line in points.values() for _, share in line)
        caption = (
            f"Share of problems that are solved within a factor of the best way's {name} (performance profile).{cut}"
        )
        draw = partial(plots.profile, factors, name, each, shown.styles)
        yield Drawing(f"profile-{metric}", f"Performance profile of {name}", caption + _same(_lines(factors)), draw)


def _vary(shown: _Shown, cases: Mapping[Case, float]) -> bool:
    """Return whether results differ between problems with the same value of the parameter."""
    groups: dict[Any, list[float]] = {}
    for (problem, case), value in cases.items():
        groups.setdefault((shown.value_at[problem], case), []).append(value)
    return any(max(values) > min(values) * _NEARLY for values in groups.values())


def _pairs(found: Mapping[str, Mapping[Case, float]], one: str, other: str) -> list[tuple[float, float]]:
    return [(value, found[other][case]) for case, value in found[one].items() if case in found[other]]


def _the_same(pairs: Sequence[tuple[float, float]]) -> bool:
    return bool(pairs) and all(x == y for x, y in pairs)


def _some_cut(rows: Rows) -> bool:
    return any(row["status"] == Status.LIMIT for row in rows)


def _scatters(shown: _Shown, metric: str, found: Mapping[str, Mapping[Case, float]]) -> Iterator[Drawing]:
    """Yield scatter plots of the first way to run against others, if the results of one of the two vary."""
    name, (first, *others) = METRICS[metric], shown.styles
    drawn = 0
    for way in others:
        pairs = _pairs(found, first, way)
        vary = any(_vary(shown, found[one]) for one in (first, way))
        if drawn < MOST_PAIRS and pairs and not _the_same(pairs) and vary:
            drawn += 1
            caption = (
                f"A point for each problem that both have solved: {name} of the first against {name} of the second."
            )
            caption += " Below the line the second needs less."
            draw = partial(plots.scatter, pairs, name, (first, way), shown.styles[first].colour)
            yield Drawing(f"{metric}-{first}-{way}", f"{name}: {first} and {way}", caption, draw)


def _costs(shown: _Shown, metrics: Sequence[str]) -> Iterator[Drawing]:
    """Yield plots of costs over effort (cycles first if counted), and of the final costs if they are requested."""
    for spent in sorted(statistics.SPENT, key=lambda one: one != "cycles"):
        bands = statistics.cost_bands(shown.rows, spent)
        if bands:
            same = _same({way: (band.spent, band.median) for way, band in bands.items()})
            caption = f"Cost of the best assignment so far: median and quartiles over runs.{same}"
            draw = partial(plots.cost_over, bands, METRICS[spent], shown.styles, steps=spent == "cycles")
            yield Drawing(f"cost-over-{spent}", f"Cost over {METRICS[spent]}", caption, draw)
    if "cost" in metrics:
        yield from _final_costs(shown)


def _final_costs(shown: _Shown) -> Iterator[Drawing]:
    """Yield box plots of final costs at each value of the parameter, if they fit. Single problems form one group."""
    values = [None] if shown.over in summary.SINGLE else shown.values
    if len(values) * len(shown.styles) > MOST_BOXES:
        return
    rows = [{**row, shown.over: None} for row in shown.rows] if values == [None] else shown.rows
    found = summary.samples(rows, "cost", shown.over)
    groups = {
        str(value): {way: one.values for way in shown.styles if (one := found.get((value, way))) and one.values}
        for value in values
    }
    caption = (
        "Final costs: quartiles and median; whiskers reach to the furthest run within 1.5 times the box, and circles"
    )
    caption += " are runs beyond."
    draw = partial(plots.boxes, groups, (shown.over, METRICS["cost"]), shown.styles)
    yield Drawing("final-costs", "Final costs", caption, draw)


def _costs_differ(rows: Rows) -> bool:
    """Return whether runs on the same problem ended with different costs, as in local search."""
    found: dict[str, set[Any]] = {}
    for row in rows:
        if row["cost"] is not None and row["status"] in {Status.DONE, Status.LIMIT}:
            found.setdefault(row["digest"], set()).add(row["cost"])
    return any(len(costs) > 1 for costs in found.values())


def _file(label: str) -> str:
    return "".join(sign if sign.isalnum() else "-" for sign in label)


def file_name(name: str, part: str) -> str:
    """Return the file name for a part of the problems."""
    return f"{name}-{_file(part)}" if part else name


def unique_names(names: Sequence[str]) -> list[str]:
    """Return distinct file names by numbering duplicates: `a/b` and `a-b` have the same file name."""
    found: dict[str, None] = {}
    for name in names:
        numbered = (f"{name}-{number}" for number in itertools.count(2))
        found[next(one for one in itertools.chain([name], numbered) if one not in found)] = None
    return list(found)
