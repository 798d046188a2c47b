"""Part `dynamic`: DynABT, which goes on after a change, against ABT and AFC-ng, which begin anew.

Sequences are written to `out/bench/dynamic.csv` one by one, an epoch a line; with ROBOCHOC_BENCH_RESUME set, those
that are there already are not repeated. What they come to is in `data/dynamic.csv`.
"""

from __future__ import annotations

import os
import statistics
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import NamedTuple

from measure import ROOT, FailedError, say
from report import Row, Section, draw
from rows import append_row, read_rows, written_rows

from robochoc.generators.random_csp import random_csp
from robochoc.model.change import apply_changes
from robochoc.model.orders import Order
from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import (
    AddConstraint,
    Change,
    Constraint,
    Relation,
    RemoveConstraint,
    Robot,
    ScenarioEvent,
    Semantics,
    Team,
)
from robochoc.run import Options, Runtime, solve

RAW = ROOT / "out" / "bench" / "dynamic.csv"
DATA = Path(__file__).with_name("data") / "dynamic.csv"
READING = Path(__file__).with_name("dynamic.md")

PROTOCOLS = ("dynabt", "abt", "afc-ng")
"""The first goes on, the others begin anew."""
RATES = (2, 4, 8, 16, 32)
"""So many in a hundred constraints come and go with each event."""
AGENTS, DOMAIN = 15, 5
PAIRS = AGENTS * (AGENTS - 1) // 2
CONSTRAINTS = 50
EVENTS = 10
SEQUENCES = 15


class Series(NamedTuple):
    """Sequences of one kind at one tightness: how many constraints there are at first, and which changes come."""

    kind: str
    tightness: float


SERIES = (
    Series("mixed", 0.28),
    Series("mixed", 0.36),
    Series("mixed", 0.48),
    Series("restriction", 0.36),
    Series("relaxation", 0.36),
)


class Run(NamedTuple):
    """One epoch of one sequence by one protocol; epoch 0 is the search before the first change."""

    kind: str
    tightness: float
    rate: int
    sequence: int
    protocol: str
    epoch: int
    constraints: int
    verdict: str
    messages: int
    bytes: int
    ncccs: int
    checks: int


class Point(NamedTuple):
    """What all epochs after a change come to, of all sequences of one kind, tightness and rate, by one protocol."""

    kind: str
    tightness: float
    rate: int
    changes: int
    protocol: str
    epochs: int
    soluble: int
    messages_mean: float
    messages_median: float
    ncccs_mean: float
    ncccs_median: float
    bytes_mean: float
    checks_mean: float


def measured() -> Section:
    """Run what is not there yet; then tables and pictures."""
    points = summed_up(_runs())
    DATA.parent.mkdir(exist_ok=True)
    written_rows(DATA, Point, points)
    draw("dynamic")
    return Section(
        "dynamic",
        "Problems that change: going on, or beginning anew",
        READING.read_text().strip(),
        tuple(_table(series, points) for series in SERIES),
    )


# Sequences


def changes_an_event(rate: int) -> int:
    """How many constraints come or go with each event."""
    return round(rate * CONSTRAINTS / 100)


def journey(series: Series, rate: int, sequence: int) -> Team:
    """A team with its scenario. Mixed changes keep the number of constraints; the others pass it half way."""
    count = changes_an_event(rate)
    events = EVENTS if series.kind == "mixed" else min(EVENTS, PAIRS // count)
    half = count * events // 2
    first = CONSTRAINTS + {"mixed": 0, "restriction": -half, "relaxation": half}[series.kind]
    team = random_csp(AGENTS, DOMAIN, first / PAIRS, series.tightness, sequence)
    author = Author(team, series.tightness, Random(f"{series.kind} {rate} {sequence}"))
    return replace(
        team, scenario=tuple(ScenarioEvent(tuple(author.changes(series.kind, count))) for _ in range(events))
    )


class Author:
    """Writes changes of random constraints: any pair of robots without one may get one, any constraint may go."""

    def __init__(self, team: Team, tightness: float, chance: Random) -> None:
        self._team = team
        self._tightness = tightness
        self._chance = chance
        self._number = 0

    def changes(self, kind: str, count: int) -> Iterator[Change]:
        """The next `count` changes. Mixed ones take turns, so that one more comes than goes, or the other way."""
        for _ in range(count):
            self._number += 1
            goes = kind == "relaxation" or (kind == "mixed" and self._number % 2 == 0)
            change = self._removal() if goes else self._addition()
            self._team = apply_changes(self._team, [change])
            yield change

    def _removal(self) -> RemoveConstraint:
        held = [(robot.name, above.name, one.name) for robot, above, one in _held(self._team)]
        return RemoveConstraint(*self._chance.choice(held))

    def _addition(self) -> AddConstraint:
        linked = {(above.name, robot.name) for robot, above, _ in _held(self._team)}
        names = self._team.order
        free = [(high, low) for place, low in enumerate(names) for high in names[:place] if (high, low) not in linked]
        high, low = self._chance.choice(free)
        places = self._chance.sample(range(DOMAIN**2), round(self._tightness * DOMAIN**2))
        tuples = tuple((place // DOMAIN + 1, place % DOMAIN + 1) for place in sorted(places))
        relation = Relation(f"R{self._number}new", 2, Semantics.CONFLICTS, tuples)
        scope = (self._team[high].variables[0].name, self._team[low].variables[0].name)
        return AddConstraint(low, high, Constraint(f"C{self._number}new", relation, scope, scope))


def _held(team: Team) -> Iterator[tuple[Robot, Robot, Constraint]]:
    """Each constraint, with who holds it and towards whom."""
    for robot in team.robots:
        for parent in robot.parents:
            for constraint in parent.constraints:
                yield robot, team[parent.name], constraint


# The runs


def _runs() -> list[Run]:
    """All protocols through all sequences, of each point the first sequence first."""
    RAW.parent.mkdir(parents=True, exist_ok=True)
    if not os.environ.get("ROBOCHOC_BENCH_RESUME"):
        RAW.unlink(missing_ok=True)
    done: dict[tuple[object, ...], list[Run]] = defaultdict(list)
    for run in read_rows(RAW, Run):
        done[run[:5]].append(run)
    runs = []
    for sequence in range(SEQUENCES):
        say(f"dynamic, sequence {sequence} of each point")
        for series in SERIES:
            for rate in RATES:
                runs += _sequence(series, rate, sequence, done)
    return runs


def _sequence(series: Series, rate: int, sequence: int, done: dict[tuple[object, ...], list[Run]]) -> list[Run]:
    """One sequence by all protocols, which must agree on every epoch."""
    team = journey(series, rate, sequence)
    runs = []
    verdicts: dict[str, list[str]] = {}
    for protocol in PROTOCOLS:
        key = (*series, rate, sequence, protocol)
        epochs = done[key]
        if len(epochs) != len(team.scenario) + 1:
            epochs = list(_solved(team, key))
            for epoch in epochs:
                append_row(RAW, epoch)
        verdicts[protocol] = [epoch.verdict for epoch in epochs]
        runs += epochs
    if len(set(map(tuple, verdicts.values()))) > 1 or Verdict.UNKNOWN in verdicts[PROTOCOLS[0]]:
        raise FailedError(f"no agreement on {series}, rate {rate}, sequence {sequence}: {verdicts}")
    return runs


def _solved(team: Team, key: tuple[str, float, int, int, str]) -> Iterator[Run]:
    """Every epoch of one run; solutions have been held against every constraint."""
    protocol, sequence = key[-1], key[-2]
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, seed=sequence, order=Order.MAX_DEGREE, cache=False)
    count = sum(1 for _ in _held(team))
    for number, epoch in enumerate(solve(team, options).epochs):
        if number:
            kinds = [type(change) for change in team.scenario[number - 1].changes]
            count += kinds.count(AddConstraint) - kinds.count(RemoveConstraint)
        yield Run(*key, number, count, str(epoch.verdict), *_figures(epoch))


def _figures(epoch: EpochOutcome) -> tuple[int, int, int, int]:
    metrics = epoch.metrics
    return sum(metrics.messages.values()), metrics.bytes, metrics.ncccs, metrics.checks


# What they come to


def summed_up(runs: Iterable[Run]) -> list[Point]:
    """A point for each kind, tightness, rate and protocol, of all epochs after a change."""
    groups: dict[tuple[str, float, int, str], list[Run]] = defaultdict(list)
    for run in runs:
        if run.epoch:
            groups[run.kind, run.tightness, run.rate, run.protocol].append(run)
    return [_point(*key, group) for key, group in groups.items()]


def _point(kind: str, tightness: float, rate: int, protocol: str, runs: Sequence[Run]) -> Point:
    messages, ncccs = [run.messages for run in runs], [run.ncccs for run in runs]
    return Point(
        kind,
        tightness,
        rate,
        changes_an_event(rate),
        protocol,
        len(runs),
        sum(run.verdict == Verdict.SOLUTION for run in runs),
        round(statistics.mean(messages), 1),
        statistics.median(messages),
        round(statistics.mean(ncccs), 1),
        statistics.median(ncccs),
        round(statistics.mean(run.bytes for run in runs), 1),
        round(statistics.mean(run.checks for run in runs), 1),
    )


def _table(series: Series, points: Sequence[Point]) -> list[Row]:
    here = {(one.rate, one.protocol): one for one in points if (one.kind, one.tightness) == series}
    kinds = (f"{series.kind}, {series.tightness:g}", "epochs", "soluble")
    figures = (*(f"{metric}: {name}" for metric in ("messages", "NCCCs") for name in PROTOCOLS),)
    head = (*kinds, *figures, "messages / ABT", "NCCCs / ABT", "messages / AFC-ng", "NCCCs / AFC-ng")
    return [head, *(_row(rate, [here[rate, name] for name in PROTOCOLS]) for rate in RATES)]


def _row(rate: int, points: Sequence[Point]) -> Row:
    ours, *others = points
    figures = [f"{getattr(one, what):,.0f}" for what in ("messages_mean", "ncccs_mean") for one in points]
    ratios = [
        f"{getattr(ours, what) / getattr(other, what):.2f}"
        for other in others
        for what in ("messages_mean", "ncccs_mean")
    ]
    changes = f"{rate} % ({ours.changes})"
    return (changes, str(ours.epochs), f"{ours.soluble / ours.epochs:.0%}", *figures, *ratios)
