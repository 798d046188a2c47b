"""Statistics of results: confidence intervals for medians, tests of pairs, and profiles."""

from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from robochoc.experiments.summary import Rows, labels
from robochoc.experiments.task import Status
from robochoc.system.lazy_dataclass import dataclass

RESAMPLES = 2000
CONFIDENCE = 0.95
_SEED = 0
"""The seed for resampling, so that the same results give the same intervals."""
MOST_EXACT = 10
FEWEST_PAIRS = 6
"""With fewer pairs, no test result can be significant at 5 %."""


@dataclass(frozen=True)
class MedianInterval:
    """A median, and its confidence interval at the level `CONFIDENCE`."""

    median: float
    low: float
    high: float


@dataclass(frozen=True)
class MeanInterval:
    """A mean, and its confidence interval at the level `CONFIDENCE`."""

    mean: float
    low: float
    high: float


def median_interval(values: Sequence[float], problems: Sequence[str] = ()) -> MedianInterval:
    """Return the median of `values` and its confidence interval by the percentile bootstrap.

    Efron and Tibshirani, "An Introduction to the Bootstrap", 1993, Section 13.3. Whole problems with all their runs are
    resampled, since repetitions of one problem are not independent.

    Args:
        values: The values of the runs.
        problems: The problem of each run. Empty: all problems differ.

    Raises:
        ValueError: if there are no values.
    """
    given, drawn = _resampled(values, problems)
    low, high = _middle(weighted_medians(given, drawn))
    return MedianInterval(float(np.median(given)), low, high)


def mean_interval(values: Sequence[float], problems: Sequence[str] = ()) -> MeanInterval:
    """Return the mean of `values` and its confidence interval, in the same way as `median_interval`.

    Raises:
        ValueError: if there are no values.
    """
    given, drawn = _resampled(values, problems)
    low, high = _middle(drawn @ given / drawn.sum(axis=1))
    return MeanInterval(float(np.mean(given)), low, high)


def _resampled(values: Sequence[float], problems: Sequence[str]) -> tuple[Any, Any]:
    """Return the values in ascending order, and how often each resample contains each of them."""
    if not values:
        raise ValueError("there are no values")
    order = np.argsort(values, kind="stable")
    of_problem = np.unique(problems or np.arange(len(values)), return_inverse=True)[1][order]
    count = int(of_problem.max()) + 1
    drawn = np.random.default_rng(_SEED).multinomial(count, np.full(count, 1 / count), RESAMPLES)
    return np.asarray(values, dtype=float)[order], drawn[:, of_problem]


def _middle(resampled: Any) -> tuple[float, float]:  # noqa: ANN401 - an array of floats
    """Return the bounds of the middle part of `resampled`, whose share is `CONFIDENCE`."""
    rest = (1 - CONFIDENCE) / 2
    low, high = np.quantile(resampled, [rest, 1 - rest])
    return float(low), float(high)


def weighted_medians(values: Any, counts: Any) -> Any:  # noqa: ANN401 - arrays of numbers
    """Return, for each row of `counts`, the median of the ascending `values`, each repeated by its count."""
    until = np.cumsum(counts, axis=1)
    total = until[:, -1:]
    low = values[np.argmax(until >= (total + 1) // 2, axis=1)]
    high = values[np.argmax(until >= total // 2 + 1, axis=1)]
    return (low + high) / 2


@dataclass(frozen=True)
class Comparison:
    """Two ways to run, compared on the problems that both have solved.

    Attributes:
        one: The label of the first way.
        other: The label of the second way.
        pairs: The number of problems that both ways have solved.
        one_better: The number of these problems on which the first way is better, by the median of its runs.
        other_better: The number of these problems on which the second way is better.
        ratio: The median ratio of the first way to the second. None: it does not exist.
        difference: The median difference between the first way and the second. None: there are no pairs.
        p: The p-value of the difference, corrected for the number of tests. None: there are too few pairs.
        at: The value of the parameter of runs at which the ways are compared. None: there is no such parameter.
    """

    one: str
    other: str
    pairs: int
    one_better: int
    other_better: int
    ratio: float | None
    difference: float | None
    p: float | None
    at: Any = None


def comparisons(rows: Rows, metric: str) -> list[Comparison]:
    """Compare all pairs of ways to run by Wilcoxon's signed-rank test with Holm's correction.

    Wilcoxon, "Individual comparisons by ranking methods", 1945; Holm, "A simple sequentially rejective multiple test
    procedure", 1979. Each problem counts once, however many runs it has, since runs on the same problem are not
    independent. Therefore, if results are shown over a parameter of runs, ways are compared at each value separately. A
    problem is in no pair if half or more of its runs have no verdict.
    """
    found = []
    for at in dict.fromkeys(row.get("case") for row in rows):
        own = [row for row in rows if row.get("case") == at]
        values = {way: by_problem(own, way, metric) for way in labels(own)}
        upwards = maximised(own, metric)
        pairs = itertools.combinations(values, 2)
        found += [replace(_comparison(one, other, values, upwards), at=at) for one, other in pairs]
    return _corrected(found)


def maximised(rows: Rows, metric: str) -> set[str]:
    """Return the problems with utilities, for which higher metric values are better."""
    return {row["digest"] for row in rows if row["maximises"]} if metric == "cost" else set()


Case = tuple[str, Any]
"""A problem together with the value of the parameter of runs on the axis: the unit on which two ways are compared."""


def by_problem(rows: Rows, way: str, metric: str) -> dict[Case, float]:
    """Return a metric's median over a way's runs on each problem, if more than half of these runs have a verdict."""
    upwards = maximised(rows, metric)
    runs: dict[Case, list[float]] = {}
    for row in rows:
        if row["label"] == way:
            known = row["status"] == Status.DONE and row[metric] is not None
            worst = -math.inf if row["digest"] in upwards else math.inf
            runs.setdefault(case_of(row), []).append(float(row[metric]) if known else worst)
    medians = {case: statistics.median(values) for case, values in runs.items()}
    return {case: median for case, median in medians.items() if math.isfinite(median)}


def case_of(row: Mapping[str, Any]) -> Case:
    """Return the case that a run belongs to."""
    return row["digest"], row.get("case")


def _comparison(
    one: str, other: str, values: Mapping[str, Mapping[Case, float]], upwards: Collection[str]
) -> Comparison:
    both = [case for case in values[one] if case in values[other]]
    pairs = [(values[one][case], values[other][case]) for case in both]
    differences = [a - b for a, b in pairs]
    gains = [-gap if case[0] in upwards else gap for case, gap in zip(both, differences, strict=True)]
    return Comparison(
        one,
        other,
        len(pairs),
        sum(gain < 0 for gain in gains),
        sum(gain > 0 for gain in gains),
        median_ratio(pairs),
        statistics.median(differences) if differences else None,
        paired_p_value(differences),
    )


def median_ratio(pairs: Sequence[tuple[float, float]]) -> float | None:
    """Return the median of the ratios of all `pairs`, or None if it does not exist.

    The ratio of 0 to 0 is 1; the ratio of a positive number to 0 is infinite. Negative numbers have no ratio.
    """
    if not pairs or min(map(min, pairs)) < 0:
        return None
    median = statistics.median([a / b if b else math.inf if a else 1.0 for a, b in pairs])
    return median if math.isfinite(median) else None


def paired_p_value(differences: Sequence[float]) -> float | None:
    """Return the two-sided p-value of Wilcoxon's signed-rank test, or None if there are too few differences.

    Zero differences are left out. With ties, the p-value is exact for up to `MOST_EXACT` differences, and approximate
    for more, where scipy takes seconds.
    """
    some = [one for one in differences if one]
    if len(some) < FEWEST_PAIRS:
        return None
    from scipy.stats import wilcoxon  # noqa: PLC0415 - an extra

    ties = len({abs(one) for one in some}) < len(some)
    approximate = {"method": "approx", "correction": True} if ties and len(some) > MOST_EXACT else {}
    return float(wilcoxon(some, **approximate).pvalue)


def _corrected(found: Sequence[Comparison]) -> list[Comparison]:
    """Return `found` with p-values corrected for the number of tests."""
    corrected = holm_corrected([one.p for one in found])
    return [replace(one, p=p) for one, p in zip(found, corrected, strict=True)]


def holm_corrected(values: Sequence[float | None]) -> list[float | None]:
    """Return p-values corrected for their number by Holm's method, which scipy lacks. None, no test, remains None."""
    tested = sorted((p, place) for place, p in enumerate(values) if p is not None)
    corrected: dict[int, float] = {}
    highest = 0.0
    for rank, (p, place) in enumerate(tested):
        highest = max(highest, min(1.0, p * (len(tested) - rank)))
        corrected[place] = highest
    return [corrected.get(place) for place in range(len(values))]


def cactus(rows: Rows, metric: str) -> dict[str, list[float]]:
    """Return, for each way to run, the metric values of the solved problems in ascending order."""
    return {way: sorted(by_problem(rows, way, metric).values()) for way in labels(rows)}


def performance_profile(rows: Rows, metric: str) -> dict[str, list[tuple[float, float]]]:
    """Return, for each way to run, pairs (factor, share): the share of problems solved within a factor of the best way.

    Dolan and More, "Benchmarking optimization software with performance profiles", Mathematical Programming 91, 2002.
    """
    values = {way: by_problem(rows, way, metric) for way in labels(rows)}
    cases = list(dict.fromkeys(map(case_of, rows)))
    best = {case: min((one[case] for one in values.values() if case in one), default=math.inf) for case in cases}
    profile = {}
    for way, found in values.items():
        factors = sorted(_factor(value, best[case]) for case, value in found.items())
        profile[way] = [(factor, place / len(cases)) for place, factor in enumerate(factors, 1)]
    return profile


def _factor(value: float, best: float) -> float:
    return 1.0 if value == best else value / best if best else math.inf


@dataclass(frozen=True)
class Band:
    """The cost of the best assignment so far over the effort: quartiles over all runs, at each value in `spent`."""

    spent: tuple[float, ...]
    low: tuple[float, ...]
    median: tuple[float, ...]
    high: tuple[float, ...]


_POINTS = 200
SPENT: Mapping[str, int] = MappingProxyType({"messages": 0, "ncccs": 1, "cycles": 2, "simulated_s": 2})
"""The measures of effort, with their indices in a point of a curve. The third is the time, in the run's unit."""


def cost_bands(rows: Rows, spent: str) -> dict[str, Band]:
    """Return, for each way to run, the cost of its best assignment over the effort `spent`, a key of `SPENT`.

    A band starts where all runs of the way have an assignment. Runs that do not count `spent` are left out.
    """
    bands = {}
    for way in labels(rows):
        of_way = [row for row in rows if row["label"] == way and row[spent] is not None]
        curves = [_curve(row, spent) for row in of_way if row["cost_over_time"]]
        if curves:
            bands[way] = _band(curves)
    return bands


def _curve(row: Mapping[str, Any], spent: str) -> list[tuple[float, float]]:
    points = [(float(point[SPENT[spent]]), float(point[3])) for point in row["cost_over_time"]]
    return [*points, (max(points[-1][0], float(row[spent])), points[-1][1])]


def _band(curves: Sequence[Sequence[tuple[float, float]]]) -> Band:
    first = max(curve[0][0] for curve in curves)
    last = max(first, *(curve[-1][0] for curve in curves))
    spent = np.unique(np.linspace(first, last, _POINTS))
    costs = np.array([_at(curve, spent) for curve in curves])
    low, median, high = np.quantile(costs, [0.25, 0.5, 0.75], axis=0)
    return Band(tuple(spent.tolist()), tuple(low.tolist()), tuple(median.tolist()), tuple(high.tolist()))


def _at(curve: Sequence[tuple[float, float]], spent: Any) -> list[float]:  # noqa: ANN401 - an array of floats
    """Return the cost at the last point before each value in `spent`."""
    places = np.searchsorted([point[0] for point in curve], spent, side="right") - 1
    return [curve[max(0, int(place))][1] for place in places]
