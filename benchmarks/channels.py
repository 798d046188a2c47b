"""Part `channels`: simulated time by radio, by the four channel models, beside NCCCs, messages and bytes.

Runs are written to `data/channels.csv` as they are.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from measure import FailedError, say
from report import Row, Section
from rows import written_rows

from robochoc.communication.simulator.channel import CHANNELS
from robochoc.communication.simulator.simulator import Simulation
from robochoc.communication.simulator.timed import Timed
from robochoc.generators.random_csp import random_csp
from robochoc.model.orders import Order, with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run.registry import protocol_named
from robochoc.verification.checker import assignment_cost

DATA = Path(__file__).with_name("data") / "channels.csv"
READING = Path(__file__).with_name("channels.md")
PROBLEMS = 20
LIMIT = 100_000
"""A run that has sent so many messages is broken off."""


class Series(NamedTuple):
    """Problems of one kind, and who solves them; `proven` says who finds the least cost."""

    name: str
    protocols: tuple[str, ...]
    team: Callable[[int], Team]
    proven: tuple[str, ...]


class Run(NamedTuple):
    """One protocol on one problem by one channel."""

    series: str
    problem: int
    protocol: str
    channel: str
    verdict: str
    cost: float
    messages: int
    bytes: int
    ncccs: int
    simulated_s: float


def _constraints(problem: int) -> Team:
    return with_order(random_csp(15, 5, 0.3, 0.48, problem, connected=True), Order.MAX_DEGREE)


def _costs(problem: int) -> Team:
    return with_order(random_csp(10, 5, 0.3, 0, problem, connected=True, max_cost=100), Order.MAX_DEGREE)


SERIES = (
    Series("constraints", ("abt", "afc-ng", "afc", "dynabt", "disfc"), _constraints, ()),
    Series("costs", ("sfb", "dpop", "bnb-adopt", "mgm"), _costs, ("sfb", "dpop", "bnb-adopt")),
)


def measured() -> Section:
    """All runs; then a table for each series."""
    runs = list(_runs())
    DATA.parent.mkdir(exist_ok=True)
    written_rows(DATA, Run, runs)
    tables = [_table(series, [run for run in runs if run.series == series.name]) for series in SERIES]
    return Section("channels", "Protocols by radio", READING.read_text().strip(), tuple(tables))


def _runs() -> Iterator[Run]:
    for series in SERIES:
        say(f"channels, {series.name}")
        for problem in range(PROBLEMS):
            team = series.team(problem)
            runs = [_run(series, team, problem, name, channel) for name in series.protocols for channel in CHANNELS]
            _agree(series, runs)
            yield from runs


def _run(series: Series, team: Team, problem: int, name: str, channel: str) -> Run:
    result = Simulation(team, protocol_named(name), Timed(problem, CHANNELS[channel])).search(messages=LIMIT)
    metrics = result.metrics
    figures = sum(metrics.messages.values()), metrics.bytes, metrics.ncccs, metrics.simulated_s
    pays = assignment_cost(team, {name: value for own in result.assignments.values() for name, value in own.items()})
    return Run(series.name, problem, name, channel, str(result.verdict), pays, *figures)


def _agree(series: Series, runs: Sequence[Run]) -> None:
    """Whatever the radio, the answers are the same."""
    ended = [run for run in runs if run.verdict != Verdict.UNKNOWN]
    sure = [run for run in ended if run.protocol in series.proven]
    if len({run.cost for run in sure}) > 1 or (not series.proven and len({run.verdict for run in ended}) > 1):
        raise FailedError(f"problem {runs[0].problem} of {series.name}: answers differ: {ended}")


def _table(series: Series, runs: Sequence[Run]) -> list[Row]:
    """Simulated seconds by each channel; what the protocol needs otherwise, as least and most of the channels."""
    metrics = ("messages", "bytes", "ncccs")
    names = ("messages", "bytes", "NCCCs")
    head = (series.name, *(f"{name}, s (rank)" for name in CHANNELS), *names)
    times = {
        (name, channel): _median(runs, name, channel, "simulated_s")
        for name in series.protocols
        for channel in CHANNELS
    }
    rows = [head]
    for name in series.protocols:
        cells = []
        for channel in CHANNELS:
            rank = sorted(times[other, channel] for other in series.protocols).index(times[name, channel]) + 1
            cells.append(f"{_least(runs, name, channel)}{times[name, channel]:,.2f} ({rank})")
        for metric in metrics:
            medians = [_median(runs, name, channel, metric) for channel in CHANNELS]
            low, high = f"{min(medians):,.0f}", f"{max(medians):,.0f}"
            cells.append(low if low == high else f"{low} to {high}")
        rows.append((name, *cells))
    return rows


def _median(runs: Sequence[Run], name: str, channel: str, metric: str) -> float:
    values: list[float] = [getattr(run, metric) for run in runs if (run.protocol, run.channel) == (name, channel)]
    return statistics.median(values)


def _least(runs: Sequence[Run], name: str, channel: str) -> str:
    """A mark for a median of runs that were broken off."""
    off = [run.verdict == Verdict.UNKNOWN for run in runs if (run.protocol, run.channel) == (name, channel)]
    return ">= " * (2 * sum(off) >= len(off))
