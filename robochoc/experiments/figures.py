"""The figures of a report. The only file that needs matplotlib: the extra `experiments`.

Lines differ in colour, in dashes and in markers: the colours are those of Okabe and Ito, "Color Universal Design",
2008, which the colour-blind can tell apart, and the rest serves who prints in grey.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from robochoc.experiments import statistics, summary
from robochoc.experiments.summary import METRICS, Rows

_SETTINGS = {
    "font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.alpha": 0.25,
    "legend.frameon": False, "legend.fontsize": 8, "svg.hashsalt": "robochoc",
    "pdf.fonttype": 42, "lines.linewidth": 1.4, "lines.markersize": 4.5, "figure.constrained_layout.use": True,
}  # fmt: skip
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000", "#e69f00", "#56b4e9", "#7f7f7f")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
_DASHES = ("-", "--", "-.", ":")
_SIZE = (4.6, 3.2)
"""Inches: one column of a paper, and a little more."""
_WIDE_RANGE = 30
"""Axes are logarithmic where the largest value is so many times the smallest."""
MOST_PROFILES, MOST_PAIRS = 2, 4
"""Profiles of more metrics, and scatters of more pairs, nobody looks at."""


class Style(NamedTuple):
    """How one way to run is drawn."""

    colour: str
    marker: str
    dashes: str


@dataclass(frozen=True)
class Drawing:
    """A figure: the name of its file, what it shows, and what draws it."""

    name: str
    title: str
    caption: str
    draw: Callable[[Axes], None]

    def __post_init__(self) -> None:
        """Make of the name one that a file can have: there are names of parameters in it, which come from a file."""
        object.__setattr__(self, "name", _file(self.name))

    def svg(self, *, text: bool = False) -> bytes:
        """Return it as SVG; with `text`, words are text in the reader's own font, and not shapes."""
        return self._saved("svg", {"Date": None}, {"svg.fonttype": "none" if text else "path"})

    def pdf(self) -> bytes:
        """Return it as PDF."""
        return self._saved("pdf", {"CreationDate": None}, {})

    def _saved(self, form: str, metadata: dict[str, None], settings: dict[str, str]) -> bytes:
        with mpl.rc_context({**_SETTINGS, **settings}):
            figure = Figure(figsize=_SIZE)
            axes = figure.add_subplot()
            self.draw(axes)
            _plain_ticks(axes)
            out = io.BytesIO()
            figure.savefig(out, format=form, metadata=metadata)
        return out.getvalue()


def drawings(rows: Rows, over: str, metrics: Sequence[str]) -> Iterator[Drawing]:
    """Yield the figures that the results have something to say in."""
    styles = _styles(summary.labels(rows))
    several = len(summary.values_of(rows, over)) > 1
    for metric in metrics:
        name = METRICS[metric]
        if several:
            told = f"Median of {name}, and the interval that holds it with 95 % (bootstrap)."
            hollow = " A hollow mark: limits ended half of the runs or more, and the value is a lower bound."
            draw = partial(_over_parameter, rows, metric, over, styles)
            yield Drawing(f"{metric}-over-{over}", f"{name} over {over}", told + hollow, draw)
    if several:
        told = "Share of runs with a verdict (lines), and of problems with a solution (shaded)."
        yield Drawing(f"solved-over-{over}", f"Solved, over {over}", told, partial(_solved, rows, over, styles))
    for metric in [one for one in metrics if one in summary.CENSORED][:MOST_PROFILES]:
        yield from _profiles(rows, metric, styles)
    for spent in statistics.SPENT:
        if statistics.cost_bands(rows, spent):
            told = "Cost of the best assignment so far: median and quartiles over runs."
            draw = partial(_cost_over, rows, spent, styles)
            yield Drawing(f"cost-over-{spent}", f"Cost over {METRICS[spent]}", told, draw)


def _profiles(rows: Rows, metric: str, styles: dict[str, Style]) -> Iterator[Drawing]:
    name = METRICS[metric]
    if len(styles) == 1:
        return
    told = f"How many runs have a verdict within so many {name} each (cactus plot)."
    yield Drawing(f"cactus-{metric}", f"Runs solved within {name}", told, partial(_cactus, rows, metric, styles))
    told = f"Share of runs with a verdict within a factor of the best way's {name} (performance profile)."
    draw = partial(_profile, rows, metric, styles)
    yield Drawing(f"profile-{metric}", f"Performance profile of {name}", told, draw)
    ways = list(styles)
    for other in ways[1 : MOST_PAIRS + 1]:
        told = f"A point for each run that both have solved: {name} of the one against {name} of the other."
        draw = partial(_scatter, rows, metric, (ways[0], other))
        yield Drawing(f"{metric}-{_file(ways[0])}-{_file(other)}", f"{name}: {ways[0]} and {other}", told, draw)


def _file(label: str) -> str:
    return "".join(sign if sign.isalnum() else "-" for sign in label)


def file_name(name: str, part: str) -> str:
    """Return the name of a file about a part of the problems."""
    return f"{name}-{_file(part)}" if part else name


def _styles(ways: Sequence[str]) -> dict[str, Style]:
    return {
        way: Style(
            _COLOURS[place % len(_COLOURS)],
            _MARKERS[place % len(_MARKERS)],
            _DASHES[(place + place // len(_COLOURS)) % len(_DASHES)],
        )
        for place, way in enumerate(ways)
    }


def _scale(axis: Any, values: Sequence[float]) -> None:  # noqa: ANN401 - a setter of matplotlib
    """Make an axis logarithmic where values differ much."""
    positive = [value for value in values if value > 0]
    if positive and len(positive) == len(values) and max(positive) >= _WIDE_RANGE * min(positive):
        axis("log")


def _plain_ticks(axes: Axes) -> None:
    """Have no numbers between the powers of ten: on small figures they lie upon each other."""
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            low, high = axis.get_view_interval()
            if high / low >= 10:  # noqa: PLR2004 - one power of ten
                axis.set_minor_formatter(NullFormatter())


def _places(values: Sequence[Any], axes: Axes, name: str) -> list[float]:
    """Return where the values of a parameter are on the x-axis: at themselves if they are numbers, else in a row."""
    axes.set_xlabel(name)
    if all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values):
        if all(isinstance(value, int) for value in values):
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        return [float(value) for value in values]
    axes.set_xticks(range(len(values)), [str(value) for value in values])
    return [float(place) for place in range(len(values))]


def _over_parameter(rows: Rows, metric: str, over: str, styles: dict[str, Style], axes: Axes) -> None:
    values = summary.values_of(rows, over)
    places = dict(zip(values, _places(values, axes, over), strict=True))
    found = summary.samples(rows, metric, over)
    drawn: list[float] = []
    for way, style in styles.items():
        here = [(places[value], one) for value in values if (one := found.get((value, way))) and one.values]
        bands = [(place, statistics.median_interval(one.values), one.open_ended) for place, one in here]
        where, medians = [place for place, *_ in bands], [band.median for _, band, _ in bands]
        drawn += medians
        axes.plot(where, medians, color=style.colour, linestyle=style.dashes, label=way)
        axes.fill_between(
            where, [band.low for _, band, _ in bands], [band.high for _, band, _ in bands],
            color=style.colour, alpha=0.15, linewidth=0,
        )  # fmt: skip
        for place, band, is_open in bands:
            face = "white" if is_open else style.colour
            axes.plot(place, band.median, style.marker, color=style.colour, markerfacecolor=face)
    _scale(axes.set_yscale, drawn)
    axes.set_ylabel(METRICS[metric])
    _legend(axes, styles)


def _legend(axes: Axes, styles: dict[str, Style]) -> None:
    """Draw the legend with lines and markers, however they were drawn."""
    handles = [
        mpl.lines.Line2D([], [], color=one.colour, linestyle=one.dashes, marker=one.marker, label=way)
        for way, one in styles.items()
    ]
    axes.legend(handles=handles)


def _solved(rows: Rows, over: str, styles: dict[str, Style], axes: Axes) -> None:
    values = summary.values_of(rows, over)
    places = _places(values, axes, over)
    for way, style in styles.items():
        shares = [_share([row for row in rows if row.get(over) == value and row["label"] == way]) for value in values]
        axes.plot(places, shares, color=style.colour, linestyle=style.dashes, marker=style.marker, label=way)
    solutions = [_solutions([row for row in rows if row.get(over) == value]) for value in values]
    axes.fill_between(places, solutions, color="#999999", alpha=0.2, linewidth=0)
    axes.set_ylim(-0.03, 1.03)
    axes.set_ylabel("share of runs")
    axes.legend()


def _share(rows: Rows) -> float:
    return sum(row["status"] == "done" for row in rows) / len(rows) if rows else float("nan")


def _solutions(rows: Rows) -> float:
    """Return the share of problems with a solution, of those that some way to run has solved."""
    solved = {row["digest"]: row["verdict"] != "no-solution" for row in rows if row["status"] == "done"}
    return sum(solved.values()) / len(solved) if solved else float("nan")


def _cactus(rows: Rows, metric: str, styles: dict[str, Style], axes: Axes) -> None:
    found = statistics.cactus(rows, metric)
    for way, values in found.items():
        style = styles[way]
        every = max(1, len(values) // 12)
        axes.plot(
            range(1, len(values) + 1), values, color=style.colour, linestyle=style.dashes, marker=style.marker,
            markevery=every, label=way,
        )  # fmt: skip
    _scale(axes.set_yscale, [value for values in found.values() for value in values])
    axes.set_xlabel("runs with a verdict")
    axes.set_ylabel(f"{METRICS[metric]}, each at most")
    axes.legend()


def _profile(rows: Rows, metric: str, styles: dict[str, Style], axes: Axes) -> None:
    for way, points in statistics.performance_profile(rows, metric).items():
        style = styles[way]
        factors = [1.0, *(factor for factor, _ in points)]
        shares = [0.0, *(share for _, share in points)]
        axes.step(
            factors, shares, where="post", color=style.colour, linestyle=style.dashes, marker=style.marker,
            markevery=max(1, len(factors) // 12), label=way,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel(f"{METRICS[metric]}, as a multiple of the best way's")
    axes.set_ylabel("share of runs with a verdict")
    axes.legend(loc="lower right")


def _scatter(rows: Rows, metric: str, pair: tuple[str, str], axes: Axes) -> None:
    one, other = (
        {
            (row["digest"], row["seed"], row["repetition"]): float(row[metric])
            for row in rows
            if row["label"] == way and row["status"] == "done" and row[metric] is not None
        }
        for way in pair
    )
    both = [case for case in one if case in other]
    x, y = [one[case] for case in both], [other[case] for case in both]
    axes.scatter(x, y, s=14, color=_COLOURS[0], alpha=0.6, linewidths=0)
    for axis in (axes.set_xscale, axes.set_yscale):
        _scale(axis, [*x, *y])
    if both:
        ends = [min(*x, *y), max(*x, *y)]
        axes.plot(ends, ends, color="#555555", linewidth=0.8, linestyle="--")
    axes.set_xlabel(f"{METRICS[metric]} of {pair[0]}")
    axes.set_ylabel(f"{METRICS[metric]} of {pair[1]}")


def _cost_over(rows: Rows, spent: str, styles: dict[str, Style], axes: Axes) -> None:
    bands = statistics.cost_bands(rows, spent)
    for way, band in bands.items():
        style = styles[way]
        axes.plot(
            band.spent, band.median, color=style.colour, linestyle=style.dashes, marker=style.marker,
            markevery=max(1, len(band.spent) // 10), label=way,
        )  # fmt: skip
        axes.fill_between(band.spent, band.low, band.high, color=style.colour, alpha=0.15, linewidth=0)
    _scale(axes.set_xscale, [place for band in bands.values() for place in band.spent])
    axes.set_xlabel(METRICS[spent])
    axes.set_ylabel("cost of the best assignment so far")
    axes.legend()
