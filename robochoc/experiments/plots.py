"""The kinds of plots in a report. `figures.py` selects the plots and their data."""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from robochoc.experiments.axes import (
    Style,
    legend,
    literal,
    numbers,
    shortened_label,
    spread,
    tick_kinds,
    tick_numbers,
)
from robochoc.experiments.statistics import Band
from robochoc.system.lazy_dataclass import dataclass

_MOST_BANDS = 4
"""With more ways to run, intervals are drawn as bars, and quartiles are left out, since bands would overlap."""
_MARKERS_EVERY = 0.14
"""The distance between markers on a line with many points, as a share of the size of the axes."""
_LONG_PROFILE = 5
"""The largest factor for which the axis of a profile is linear."""
_DODGED = 0.7
"""The share of the space for one kind of problems in which the ways to run are placed side by side."""

Styles = Mapping[str, Style]
Steps = Mapping[str, Sequence[float]]
"""The values at which each way's line rises, in ascending order, by way to run."""


@dataclass(frozen=True)
class Spot:
    """The results of one way to run at one value of the parameter: a median and its interval."""

    at: Any
    median: float
    low: float
    high: float
    open_ended: bool = False


def same_lines(lines: Mapping[str, Hashable]) -> list[list[str]]:
    """Return the groups of ways to run with identical lines."""
    groups: dict[Hashable, list[str]] = {}
    for way, line in lines.items():
        groups.setdefault(line, []).append(way)
    return [group for group in groups.values() if len(group) > 1]


def _line(axes: Axes, x: Sequence[float], y: Sequence[float], style: Style, above: int = 0, **more: Any) -> None:  # noqa: ANN401 - of `plot`
    """Draw a line, wider if identical lines will be drawn over it, so that all of them are visible."""
    wider = min(above, 3)
    axes.plot(
        x, y, color=style.colour, linestyle=style.dashes, marker=style.marker,
        linewidth=1.4 + 2 * wider, markersize=mpl.rcParams["lines.markersize"] + 3 * wider, **more,
    )  # fmt: skip


def _lines_above(lines: Mapping[str, Hashable]) -> dict[str, int]:
    """Return, for each way to run, the number of identical lines that are drawn later."""
    return {way: place for group in same_lines(lines) for place, way in enumerate(reversed(group))}


def over_parameter(
    spots: Mapping[str, Sequence[Spot]], values: Sequence[Any], names: tuple[str, str], styles: Styles, axes: Axes
) -> None:
    """Draw medians with intervals over the values of a parameter. `names`: the names of the parameter and the metric.

    Lines join the medians at numbers. At kinds of problems, the ways to run are side by side, without lines.
    """
    axes.set_xlabel(literal(names[0]))
    shown = {way: style for way, style in styles.items() if spots.get(way)}
    spread(axes, "y", [value for way in shown for spot in spots[way] for value in (spot.low, spot.high)])
    if numbers(values):
        tick_numbers(axes, values)
        above = _lines_above({way: tuple((spot.at, spot.median) for spot in spots[way]) for way in shown})
        for way, style in shown.items():
            _median_line(axes, spots[way], style, above.get(way, 0), band=len(shown) <= _MOST_BANDS)
    else:
        tick_kinds(axes, [str(value) for value in values], names[0])
        for place, (way, style) in enumerate(shown.items()):
            beside = _DODGED * ((place + 0.5) / len(shown) - 0.5)
            for spot in spots[way]:
                _mark(axes, values.index(spot.at) + beside, spot, style, bar=True)
    axes.set_ylabel(names[1])
    legend(axes, shown, lines=numbers(values))


def _median_line(axes: Axes, spots: Sequence[Spot], style: Style, above: int, *, band: bool) -> None:
    where = [spot.at for spot in spots]
    _line(axes, where, [spot.median for spot in spots], style._replace(marker=""), above)
    if band:
        low, high = [spot.low for spot in spots], [spot.high for spot in spots]
        axes.fill_between(where, low, high, color=style.colour, alpha=0.15, linewidth=0)
    for spot in spots:
        _mark(axes, spot.at, spot, style, above, bar=not band)


def _mark(axes: Axes, at: float, spot: Spot, style: Style, above: int = 0, *, bar: bool) -> None:
    """Draw a median, hollow if it is only a lower bound, with its interval as a bar."""
    if bar and spot.low < spot.high:
        axes.vlines(at, spot.low, spot.high, color=style.colour, linewidth=1, alpha=0.7)
    face = "white" if spot.open_ended else style.colour
    _line(axes, [at], [spot.median], style, above, markerfacecolor=face, zorder=3)


def shares(
    found: Mapping[str, Sequence[float]], values: Sequence[Any], solutions: Sequence[float], names: tuple[str, str],
    styles: Styles, axes: Axes,
) -> None:  # fmt: skip
    """Draw the share of runs with a verdict over a parameter, and in grey the share of problems with a solution."""
    axes.set_xlabel(literal(names[0]))
    if numbers(values):
        tick_numbers(axes, values)
        axes.fill_between(values, solutions, color="#999999", alpha=0.2, linewidth=0)
        if not found:
            axes.plot(values, solutions, color="#555555", marker="o")
        above = _lines_above({way: tuple(line) for way, line in found.items()})
        for way, line in found.items():
            _line(axes, values, line, styles[way], above.get(way, 0))
    else:
        tick_kinds(axes, [str(value) for value in values], names[0])
        axes.bar(range(len(values)), solutions, 0.9, color="#999999", alpha=0.2, linewidth=0)
        for place, (way, line) in enumerate(found.items()):
            beside = _DODGED * ((place + 0.5) / len(found) - 0.5)
            _line(axes, [at + beside for at in range(len(values))], line, styles[way]._replace(dashes=""))
    axes.set_ylim(-0.03, 1.03)
    axes.set_ylabel(names[1])
    if found:
        legend(axes, {way: styles[way] for way in found}, lines=numbers(values))


def cactus(steps: Steps, name: str, styles: Styles, axes: Axes) -> None:
    """Draw the number of runs solved within each value of the metric. Lines continue to the right edge."""
    values = [value for line in steps.values() for value in line]
    spread(axes, "x", values)
    _stairs(axes, steps, styles, 1, max(values))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylim(bottom=0)
    axes.set_xlabel(f"{name}, each at most")
    axes.set_ylabel("problems solved")


def profile(steps: Steps, name: str, each: float, styles: Styles, axes: Axes) -> None:
    """Draw the share of runs within each factor of the best way. Each run adds `each` to the share."""
    last = max(factor for line in steps.values() for factor in line)
    if last > _LONG_PROFILE:
        axes.set_xscale("log")
    _stairs(axes, steps, styles, each, last, first=1.0)
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel(f"{name}, as a multiple of the best way's")
    axes.set_ylabel("share of problems solved")


def _stairs(axes: Axes, steps: Steps, styles: Styles, each: float, last: float, first: float | None = None) -> None:
    """Draw lines that rise by `each` at each step, from `first` (or the first step) to just beyond `last`."""
    begin = min((line[0] for line in steps.values() if line), default=last) if first is None else first
    room = (last - begin) * 0.05 or 1.0
    edge = last + room if axes.get_xscale() == "linear" else last * 1.1
    above = _lines_above({way: tuple(line) for way, line in steps.items()})
    for place, (way, line) in enumerate(steps.items()):
        x = [begin, *line, edge]
        y = [0.0, *(each * (count + 1) for count in range(len(line))), each * len(line)]
        start = _MARKERS_EVERY * place / len(steps)  # keeps the markers of identical lines apart
        more = {"drawstyle": "steps-post", "markevery": (start, _MARKERS_EVERY)}
        _line(axes, x, y, styles[way], above.get(way, 0), **more)
    axes.set_xlim(right=edge)
    legend(axes, {way: styles[way] for way in steps})


def scatter(pairs: Sequence[tuple[float, float]], name: str, ways: tuple[str, str], colour: str, axes: Axes) -> None:
    """Draw a point for each case, whose coordinates are the results of two ways to run."""
    values = [value for pair in pairs for value in pair]
    axes.scatter([x for x, _ in pairs], [y for _, y in pairs], s=14, color=colour, alpha=0.6, linewidths=0)
    for which in ("x", "y"):
        spread(axes, which, values)
    low, high = min(values), max(values)
    axes.plot([low, high], [low, high], color="#555555", linewidth=0.8, linestyle="--")
    axes.set_ylim(axes.get_xlim())
    axes.set_xlabel(literal(f"{name} of {shortened_label(ways[0])}"))
    axes.set_ylabel(literal(f"{name} of {shortened_label(ways[1])}"))


def cost_over(bands: Mapping[str, Band], name: str, styles: Styles, axes: Axes, *, steps: bool) -> None:
    """Draw the cost of the best assignment so far over the effort; `steps`: on a linear axis with integers."""
    above = _lines_above({way: (band.spent, band.median) for way, band in bands.items()})
    for place, (way, band) in enumerate(bands.items()):
        start = _MARKERS_EVERY * place / len(bands)
        every = (start, _MARKERS_EVERY)
        _line(axes, band.spent, band.median, styles[way], above.get(way, 0), markevery=every)
        if len(bands) <= _MOST_BANDS:
            axes.fill_between(band.spent, band.low, band.high, color=styles[way].colour, alpha=0.15, linewidth=0)
    if steps:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    else:
        spread(axes, "x", [end for band in bands.values() for end in (band.spent[0], band.spent[-1])])
    axes.set_xlabel(name)
    axes.set_ylabel("best cost so far")
    legend(axes, {way: styles[way] for way in bands})


def boxes(
    groups: Mapping[str, Mapping[str, Sequence[float]]], names: tuple[str, str], styles: Styles, axes: Axes
) -> None:
    """Draw the values of each way to run as a box plot with quartiles (Tukey, "Exploratory Data Analysis", 1977).

    The boxes of several groups are side by side. If there is only one group, the ways' names are below the boxes.
    """
    ways = [way for way in styles if any(way in group for group in groups.values())]
    alone = len(groups) == 1
    for at, group in enumerate(groups.values()):
        for place, way in enumerate(ways):
            where = place if alone else at + _DODGED * ((place + 0.5) / len(ways) - 0.5)
            if way in group:
                _box(axes, where, 0.55 if alone else 0.8 * _DODGED / len(ways), group[way], styles[way].colour)
    tick_kinds(axes, ways if alone else list(groups), "" if alone else names[0])
    axes.set_ylabel(names[1])
    if not alone:
        legend(axes, {way: styles[way] for way in ways}, lines=False)


def _box(axes: Axes, where: float, width: float, values: Sequence[float], colour: str) -> None:
    drawn = axes.boxplot([values], positions=[where], widths=width)
    for part in itertools.chain.from_iterable(drawn.values()):
        part.set_color(colour)
    for part in drawn["fliers"]:
        part.set(markeredgecolor=colour, markersize=3)
    for part in drawn["medians"]:
        part.set_linewidth(2.2)
