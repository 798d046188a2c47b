"""Part `sweep`: every protocol on random problems of Model B, over the tightness of their constraints.

Runs are written to `out/bench/sweep.csv` one by one; with ROBOCHOC_BENCH_RESUME set, those that are there already
are not repeated. What the runs at a point come to is in `data/sweep.csv`, and the pictures are drawn from that.
"""

from __future__ import annotations

import os
import statistics
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import rows
from measure import ROOT, FailedError, say
from report import Row, Section, draw
from rows import written_rows

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.model.orders import Order, with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.run.registry import protocol_named
from robochoc.verification.checker import violations

RAW = ROOT / "out" / "bench" / "sweep.csv"
DATA = Path(__file__).with_name("data") / "sweep.csv"
READING = Path(__file__).with_name("sweep.md")

PROTOCOLS = ("abt", "dynabt", "abt-do-retro", "agile-abt", "afc", "afc-ng", "afc-tree", "awc", "disfc", "sbt")
SLOW = ("awc",)
"""Protocols that get a lower limit, and fewer problems."""
LIMIT, LIMIT_SLOW = 300_000, 40_000
"""A run that has sent so many messages is broken off."""
LONGEST_S = 600.0
"""Nor does a run go on for longer; none of those in RESULTS.md did."""


class Series(NamedTuple):
    """Problems <agents, domain, density> over `tightness`, `problems` a point, and the longest delay in checks."""

    name: str
    agents: int
    domain: int
    density: float
    tightness: Sequence[float]
    problems: int
    fewer: Mapping[str, int]
    """How many problems a point protocols get that are too slow for all of them."""
    delay: int = 0


SERIES = (
    Series("sparse", 20, 10, 0.2, (0.1, 0.2, 0.3, 0.4, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.9), 50, {"awc": 8}),
    Series("dense", 15, 5, 0.7, (0.12, 0.2, 0.24, 0.28, 0.32, 0.4, 0.52), 30, {"awc": 4}),
    Series("sparse, delays", 20, 10, 0.2, (0.6, 0.65, 0.7), 10, {"awc": 0}, delay=100),
)


class Variant(NamedTuple):
    """A protocol under a priority order."""

    protocol: str
    order: Order = Order.MAX_DEGREE

    @property
    def label(self) -> str:
        """The protocol's name, with the order where it is not max-degree."""
        return self.protocol if self.order is Order.MAX_DEGREE else f"{self.protocol} {self.order}"


VARIANTS = tuple(
    Variant(protocol, order)
    for protocol in PROTOCOLS
    for order in (Order.MAX_DEGREE, *((Order.DFS,) if protocol == "afc-tree" else ()))
)


class Run(NamedTuple):
    """One protocol on one problem."""

    series: str
    tightness: float
    problem: int
    label: str
    verdict: str
    messages: int
    bytes: int
    ncccs: int
    checks: int


METRICS = ("messages", "bytes", "ncccs", "checks")


class Point(NamedTuple):
    """All runs of one protocol at one tightness. Runs that were broken off count with what they had come to."""

    series: str
    tightness: float
    label: str
    problems: int
    soluble: int
    censored: int
    messages_median: float
    messages_mean: float
    bytes_median: float
    bytes_mean: float
    ncccs_median: float
    ncccs_mean: float
    checks_median: float
    checks_mean: float


def measured() -> Section:
    """Run what is not there yet; then tables and pictures."""
    points = summed_up(_runs())
    DATA.parent.mkdir(exist_ok=True)
    written_rows(DATA, Point, points)
    draw("sweep")
    tables = [table for series in SERIES for table in _tables(series, points)]
    return Section("sweep", "Protocols over the tightness of random problems", READING.read_text().strip(), (*tables,))


# The runs


def _runs() -> list[Run]:
    """Every protocol on every problem, of each point the first problem first; all verdicts on a problem agree."""
    RAW.parent.mkdir(parents=True, exist_ok=True)
    if not os.environ.get("ROBOCHOC_BENCH_RESUME"):
        RAW.unlink(missing_ok=True)
    done = {run[:4]: run for run in rows.read_rows(RAW, Run)}
    runs = []
    truth: dict[tuple[str, float, int], str] = {}
    for series, tightness, problem in _problems():
        for variant in VARIANTS:
            if problem >= series.fewer.get(variant.protocol, series.problems):
                continue
            run = done.get((series.name, tightness, problem, variant.label))
            if run is None:
                run = _run(series, tightness, problem, variant)
                rows.append_row(RAW, run)
            runs.append(run)
            if run.verdict != Verdict.UNKNOWN and truth.setdefault(run[:3], run.verdict) != run.verdict:
                raise FailedError(f"{run.label} says {run.verdict} on {run[:3]}, others say {truth[run[:3]]}")
    return runs


def _problems() -> Iterator[tuple[Series, float, int]]:
    for problem in range(max(series.problems for series in SERIES)):
        say(f"sweep, problem {problem} of each point")
        for series in SERIES:
            if problem < series.problems:
                yield from ((series, tightness, problem) for tightness in series.tightness)


def _run(series: Series, tightness: float, problem: int, variant: Variant) -> Run:
    team = random_csp(series.agents, series.domain, series.density, tightness, problem, connected=True)
    limit = LIMIT_SLOW if variant.protocol in SLOW else LIMIT
    protocol = protocol_named(variant.protocol)
    figures = solved(with_order(team, variant.order), protocol, Concurrent(problem, series.delay), limit)
    return Run(series.name, tightness, problem, variant.label, *figures)


def solved(team: Team, protocol: type[Protocol], schedule: Concurrent, limit: int) -> tuple[str, int, int, int, int]:
    """Verdict, messages, bytes, NCCCs and checks of one run. Raises `FailedError` where a solution is none."""
    result = Simulation(team, protocol, schedule).search(LONGEST_S, limit)
    if result.verdict is Verdict.SOLUTION:
        assignment = {name: value for own in result.assignments.values() for name, value in own.items()}
        if faults := list(violations(team, assignment, ())):
            raise FailedError(f"{protocol.__name__} on {team.name}: {faults[0]}")
    metrics = result.metrics
    return str(result.verdict), sum(metrics.messages.values()), metrics.bytes, metrics.ncccs, metrics.checks


# What they come to


def summed_up(runs: Iterable[Run]) -> list[Point]:
    """One point for each protocol at each tightness of each series."""
    groups: dict[tuple[str, float, str], list[Run]] = defaultdict(list)
    for run in runs:
        groups[run.series, run.tightness, run.label].append(run)
    return [_point(key, group) for key, group in sorted(groups.items())]


def _point(key: tuple[str, float, str], runs: Sequence[Run]) -> Point:
    verdicts = [run.verdict for run in runs]
    figures = []
    for metric in METRICS:
        values: list[int] = [getattr(run, metric) for run in runs]
        figures += [statistics.median(values), round(statistics.mean(values), 1)]
    return Point(*key, len(runs), verdicts.count(Verdict.SOLUTION), verdicts.count(Verdict.UNKNOWN), *figures)


# Tables


def _tables(series: Series, points: Sequence[Point]) -> Iterator[list[Row]]:
    """Messages and NCCCs over tightness; then all metrics at the peak, where ABT needs most messages."""
    here = {(one.label, one.tightness): one for one in points if one.series == series.name}
    labels = [variant.label for variant in VARIANTS if any(label == variant.label for label, _ in here)]
    for metric in ("messages", "ncccs"):
        head = (f"{series.name}: {metric}, median", *(f"{tightness:g}" for tightness in series.tightness))
        cells = [
            (label, *(_cell(here.get((label, tightness)), f"{metric}_median") for tightness in series.tightness))
            for label in labels
        ]
        yield [head, *cells, *(_remarks(series, here) if metric == "messages" else [])]
    peak = max(series.tightness, key=lambda tightness: here["abt", tightness].messages_median)
    head = (f"{series.name}, {peak:g}", "problems", "broken off", *(f"{m}: median (mean)" for m in METRICS))
    yield [head, *(_peak_row(here[label, peak]) for label in labels)]


def _remarks(series: Series, here: Mapping[tuple[str, float], Point]) -> Iterator[Row]:
    """How many of a point's problems have a solution, and which runs were broken off."""
    shares = (here["abt", tightness] for tightness in series.tightness)
    yield ("(with a solution)", *(f"{one.soluble / one.problems:.0%}" for one in shares))
    off = [
        [one for (_, there), one in here.items() if there == tightness and one.censored]
        for tightness in series.tightness
    ]
    if any(off):
        yield ("(broken off)", *(", ".join(f"{one.label} {one.censored}" for one in ones) or "-" for ones in off))


def _peak_row(point: Point) -> Row:
    cells = [f"{_cell(point, f'{m}_median')} ({_cell(point, f'{m}_mean', censored=1)})" for m in METRICS]
    return (point.label, str(point.problems), str(point.censored), *cells)


def _cell(point: Point | None, what: str, censored: int | None = None) -> str:
    """A figure; at least so much, where runs that were broken off (by default: half of them) leave it open."""
    if point is None:
        return "-"
    figure: float = getattr(point, what)
    least = point.problems / 2 if censored is None else censored
    return f"{'>= ' * (point.censored >= least)}{figure:,.0f}"
