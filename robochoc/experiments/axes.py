"""Styles of lines, scales, ticks and legends of figures. This file, `plots.py` and `figures.py` need matplotlib.

Lines differ in colour, dashes and markers. The colours are from Okabe and Ito, "Color Universal Design", 2008, and
distinguishable for colour-blind readers; dashes and markers remain distinct in grey.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000", "#e69f00", "#56b4e9", "#7f7f7f")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
_DASHES = ("-", "--", "-.", ":")
MOST_WAYS = len(_MARKERS) * len(_DASHES)
"""The most ways to run in a figure. Any two differ in at least two of colour, dashes and marker, so also in grey."""
_WIDE_RANGE = 30
"""The ratio of the largest to the smallest value above which an axis becomes logarithmic."""
_BLOT = 0.05
"""The distance, as a share of the axis, below which two marks are too close."""
_EVEN = 1.01
"""Steps are even if the largest is less than this multiple of the smallest."""
_LETTER, _LINE, _HANDLE = 0.6 / 72, 1.5 / 72, 4.2 / 72
"""Sizes in inches per point of font size: a letter's width, a line's height, and the width of a legend's sample."""
_LONGEST_TICK, _LONGEST_LABEL, _TURNED = 18, 40, 35
_FEW_DECADES = 2
"""Logarithmic axes that cover fewer powers of ten have ticks at 1, 2 and 5."""
_LOWEST_PLAIN, _HIGHEST_PLAIN, _HIGHEST_LINEAR = 1e-2, 1e6, 1e7
"""A logarithmic axis shows numbers between the first two limits in full, a linear axis numbers below the third."""


class Style(NamedTuple):
    """The colour, marker and dashes of one way to run."""

    colour: str
    marker: str
    dashes: str


def styles_of(ways: Sequence[str]) -> dict[str, Style]:
    """Return a style for each of up to `MOST_WAYS` ways to run. Any two differ in at least two of three parts."""
    styles = {}
    for place, way in enumerate(ways[:MOST_WAYS]):
        turn = place // len(_COLOURS)
        marker, dashes = _MARKERS[(place + 2 * turn) % len(_MARKERS)], _DASHES[(place + turn) % len(_DASHES)]
        styles[way] = Style(_COLOURS[place % len(_COLOURS)], marker, dashes)
    return styles


def spread(axes: Axes, which: str, values: Sequence[float]) -> None:
    """Make an axis (`which`: x or y) logarithmic if its values differ much; if they include 0, linear near 0."""
    positive = [value for value in values if value > 0]
    if not positive or min(values) < 0 or max(positive) < _WIDE_RANGE * min(positive):
        return
    _logarithmic(axes, which, 10 ** math.ceil(math.log10(min(positive))), zero=len(positive) < len(values))


def _logarithmic(axes: Axes, which: str, smallest: float, *, zero: bool) -> None:
    setter: Callable[..., Any] = axes.set_xscale if which == "x" else axes.set_yscale
    if zero:  # the linear range below the smallest value is about as wide as a power of ten
        setter("symlog", linthresh=smallest, linscale=0.9)
    else:
        setter("log")


def numbers(values: Sequence[Any]) -> bool:
    """Return whether all values of a parameter are numbers. Otherwise they are categories."""
    return all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)


def tick_numbers(axes: Axes, values: Sequence[float]) -> None:
    """Set as many ticks as fit at the given values of the x-axis, which are in ascending order.

    The axis becomes logarithmic if the nearest two values are too close on a linear axis, and further apart on a
    logarithmic one.
    """
    places = [float(value) for value in values]
    at = _shares(places)
    if len(places) > 2 and places[0] >= 0 and _nearest(at) < _BLOT:  # noqa: PLR2004 - two are always apart
        smallest = next(value for value in places if value > 0)
        powers = _shares([1 + math.log10(value / smallest) if value > 0 else 0.0 for value in places])
        if _nearest(powers) > _nearest(at):
            at = powers
            _logarithmic(axes, "x", smallest, zero=places[0] == 0)
    kept = _fitting_ticks(at, [number_text(value) for value in places], _figure(axes).get_figwidth())
    axes.set_xticks([places[one] for one in kept], [number_text(places[one]) for one in kept])
    axes.xaxis.set_minor_locator(NullLocator())


def _shares(places: Sequence[float]) -> list[float]:
    """Return the positions of values on the axis, from 0 to 1."""
    low, width = places[0], places[-1] - places[0] or 1.0
    return [(place - low) / width for place in places]


def _nearest(places: Sequence[float]) -> float:
    return min(b - a for a, b in itertools.pairwise(places))


def _fitting_ticks(at: Sequence[float], texts: Sequence[str], width: float) -> list[int]:
    """Return the indices of ticks whose texts do not overlap: of evenly spaced ticks, every n-th."""
    letter: float = _LETTER * mpl.rcParams["font.size"] / (0.8 * width)

    def apart(one: int, other: int) -> bool:
        return at[other] - at[one] > letter * ((len(texts[one]) + len(texts[other])) / 2 + 1)

    gaps = [b - a for a, b in itertools.pairwise(at)]
    if gaps and max(gaps) < _EVEN * min(gaps):
        steps = (range(0, len(at), step) for step in range(1, len(at)))
        return list(next((step for step in steps if all(itertools.starmap(apart, itertools.pairwise(step)))), [0]))
    kept: list[int] = []
    for place in range(len(at)):
        if not kept or apart(kept[-1], place):
            kept.append(place)
    return kept


def tick_kinds(axes: Axes, names: Sequence[str], what: str) -> None:
    """Write names below the x-axis, shortened, and rotated (in a higher figure) if they would overlap."""
    start, texts = _short(names)
    axes.set_xlabel(literal(f"{what} ({start}…)" if start and what else what or start))
    marks = [literal(text) for text in texts]
    figure, letter = _figure(axes), _LETTER * mpl.rcParams["font.size"]
    longest = letter * max(map(len, texts), default=0)
    if longest + letter <= 0.8 * figure.get_figwidth() / max(1, len(texts)):
        axes.set_xticks(range(len(texts)), marks)
    else:
        axes.set_xticks(range(len(texts)), marks, rotation=_TURNED, ha="right", rotation_mode="anchor")
        figure.set_figheight(figure.get_figheight() + longest * math.sin(math.radians(_TURNED)))
    axes.grid(visible=False, axis="x")
    axes.set_xlim(-0.5, len(texts) - 0.5)


def _short(names: Sequence[str]) -> tuple[str, list[str]]:
    """Return the common beginning of all names that is left out, and the shortened names."""
    start = ""
    if len(names) > 1 and max(map(len, names)) > _LONGEST_TICK // 2:
        letters = itertools.takewhile(lambda column: len(set(column)) == 1, zip(*names, strict=False))
        start = "".join(column[0] for column in letters)
        while start and start[-1].isalnum():  # back to the end of a word
            start = start[:-1]
    texts = [_cut(name[len(start) :] or name, _LONGEST_TICK) for name in names]
    return (start, texts) if len(set(texts)) == len(set(names)) else ("", list(names))


def _cut(name: str, longest: int) -> str:
    """Return a name that is too long without its middle, since names often differ at their ends."""
    half = longest // 2
    return name if len(name) <= longest else f"{name[:half]}…{name[1 - half :]}"


def number_text(value: float, _place: object = None) -> str:
    """Return a number as text for an axis."""
    return f"{value:,.10g}"


def plain_ticks(axes: Axes) -> None:
    """Write plain numbers on both axes: 1, 2, 5, 10 instead of 2 x 10^0, and 10,000 instead of 10000."""
    for axis in (axes.xaxis, axes.yaxis):
        if isinstance(axis.get_major_locator(), FixedLocator):
            continue
        if axis.get_scale() == "log":
            _plain_powers(axis)
        elif axis.get_view_interval()[1] < _HIGHEST_LINEAR:
            axis.set_major_formatter(FuncFormatter(number_text))


def _plain_powers(axis: Axis) -> None:
    low, high = axis.get_view_interval()
    if high / low < 10**_FEW_DECADES:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
    if low >= _LOWEST_PLAIN and high <= _HIGHEST_PLAIN:
        axis.set_major_formatter(FuncFormatter(number_text))


def _figure(axes: Axes) -> Figure:
    figure = axes.get_figure(root=True)
    if figure is None:
        raise ValueError("the axes are not part of a figure")
    return figure


def legend(axes: Axes, styles: Mapping[str, Style], *, lines: bool = True) -> None:
    """Draw the legend above the axes, and enlarge the figure by the legend's height."""
    figure = _figure(axes)
    handles = [
        mpl.lines.Line2D(
            [], [], color=one.colour, linestyle=one.dashes if lines else "", marker=one.marker,
            label=literal(shortened_label(way)),
        )
        for way, one in styles.items()
    ]  # fmt: skip
    size = mpl.rcParams["legend.fontsize"]
    width = size * (_HANDLE + _LETTER * max((len(shortened_label(way)) for way in styles), default=0))
    columns = max(1, min(len(handles), int(figure.get_figwidth() / width)))
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, columnspacing=1.2)
    figure.set_figheight(figure.get_figheight() + size * _LINE * math.ceil(len(handles) / columns))


def literal(text: str) -> str:
    """Escape `text` for matplotlib, which interprets text between dollar signs as formulas."""
    return text.replace("$", r"\$")


def shortened_label(way: str) -> str:
    """Return the label of a way to run, shortened for a legend."""
    return _cut(way, _LONGEST_LABEL)
