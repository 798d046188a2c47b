"""Part `local_search`: colourings of 1,000 robots by the protocols that prove nothing, cycle by cycle.

Runs are written to `out/bench/local_search.csv` one by one; with ROBOCHOC_BENCH_RESUME set, those that are there
already are not repeated. What they come to is in `data/local_search.csv`, and the picture is drawn from that.
"""

from __future__ import annotations

import os
import statistics
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from measure import ROOT, say, spread, timed_command
from report import Row, Section, draw
from rows import append_row, read_rows, written_rows

ONCE = str(Path(__file__).with_name("local_search_once.py"))
RAW = ROOT / "out" / "bench" / "local_search.csv"
DATA = Path(__file__).with_name("data") / "local_search.csv"
READING = Path(__file__).with_name("local_search.md")

AGENTS = 1000
DEGREES = (4, 5)
"""Average degrees: up to about 4.7 most of such graphs have a colouring without conflict."""
SEEDS = range(3)
CYCLES = 100
SHOWN = (0, 1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100)
"""The cycles in data and picture."""
VARIANTS = {
    "dsa A": ("dsa", "variant=A"),
    "dsa B": ("dsa", "variant=B"),
    "dsa C": ("dsa", "variant=C"),
    "mgm": ("mgm",),
    "mgm2": ("mgm2",),
    "maxsum": ("maxsum",),
}


class Run(NamedTuple):
    """One protocol on one graph; `costs` of all cycles, with blanks between them."""

    degree: int
    label: str
    seed: int
    messages: int
    bytes: int
    ncccs: int
    cpu_s: float
    wall_s: float
    memory_mb: float
    costs: str

    @property
    def course(self) -> list[int]:
        """The cost in each cycle."""
        return [int(cost) for cost in self.costs.split()]


class Point(NamedTuple):
    """All runs of one protocol at one degree, in one cycle: means of the cost then, and of the best until then."""

    degree: int
    label: str
    cycle: int
    runs: int
    cost_mean: float
    best_mean: float


def measured() -> Section:
    """Run what is not there yet; then tables and the picture."""
    runs = list(_runs())
    DATA.parent.mkdir(exist_ok=True)
    written_rows(DATA, Point, summed_up(runs))
    draw("local_search")
    tables = tuple(_table(degree, [run for run in runs if run.degree == degree]) for degree in DEGREES)
    return Section("local_search", "Local search: colourings of 1,000 robots", READING.read_text().strip(), tables)


def _runs() -> Iterator[Run]:
    """Every protocol on every graph, the first graph of each degree first."""
    RAW.parent.mkdir(parents=True, exist_ok=True)
    if not os.environ.get("ROBOCHOC_BENCH_RESUME"):
        RAW.unlink(missing_ok=True)
    done = {run[:3]: run for run in read_rows(RAW, Run)}
    for seed in SEEDS:
        for degree in DEGREES:
            for label in VARIANTS:
                run = done.get((degree, label, seed))
                if run is None:
                    run = _run(degree, label, seed)
                    append_row(RAW, run)
                yield run


def _run(degree: int, label: str, seed: int) -> Run:
    say(f"local search, degree {degree}, seed {seed}, {label}")
    protocol, *settings = VARIANTS[label]
    words = [protocol, str(AGENTS), str(degree), str(seed), str(CYCLES), *settings]
    told = timed_command([sys.executable, ONCE, *words]).answer
    costs = " ".join(str(cost) for cost in told["costs"])
    figures = (told["messages"], told["bytes"], told["ncccs"])
    used = (round(told["cpu_s"], 3), round(told["wall_s"], 3), round(told["memory_mb"], 1))
    return Run(degree, label, seed, *figures, *used, costs)


def summed_up(runs: Sequence[Run]) -> Iterator[Point]:
    """A point for each protocol, degree and cycle shown."""
    groups: dict[tuple[int, str], list[list[int]]] = defaultdict(list)
    for run in runs:
        groups[run.degree, run.label].append(run.course)
    for (degree, label), courses in sorted(groups.items()):
        for cycle in SHOWN:
            cost = statistics.mean(course[cycle] for course in courses)
            best = statistics.mean(min(course[: cycle + 1]) for course in courses)
            yield Point(degree, label, cycle, len(courses), round(cost, 2), round(best, 2))


def _table(degree: int, runs: Sequence[Run]) -> list[Row]:
    head = (
        f"degree {degree}, {AGENTS * degree // 2:,} edges",
        "cost after 10 cycles",
        f"after {CYCLES}",
        "of the best cycle",
        "messages a cycle",
        "bytes a cycle",
        "cycles a CPU second",
        "memory, MB",
    )
    return [head, *(_row(label, [run for run in runs if run.label == label]) for label in VARIANTS)]


def _row(label: str, runs: Sequence[Run]) -> Row:
    return (
        label,
        spread((run.course[10] for run in runs), 0),
        spread((run.course[CYCLES] for run in runs), 0),
        spread((min(run.course) for run in runs), 0),
        f"{statistics.median(run.messages / CYCLES for run in runs):,.0f}",
        f"{statistics.median(run.bytes / CYCLES for run in runs):,.0f}",
        spread((CYCLES / run.cpu_s for run in runs), 1),
        f"{max(run.memory_mb for run in runs):,.0f}",
    )
