"""Part `optimum`: the complete protocols that minimise, side by side on random problems with costs.

Runs are written to `data/optimum.csv` as they are, in the simulator; the pictures are drawn from that. A part of the
problems is solved in processes too, for the time they take there.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from measure import FailedError, say
from report import Row, Section, draw
from rows import written_rows

from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.run_result import RunResult
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.model.orders import Order, with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run.registry import protocol_named
from robochoc.verification.checker import assignment_cost

DATA = Path(__file__).with_name("data") / "optimum.csv"
READING = Path(__file__).with_name("optimum.md")
PROTOCOLS = ("syncbb", "afb", "adopt", "bnb-adopt", "dpop", "sfb")
AGENTS, DOMAIN, DEAREST = 10, 5, 100
DENSITIES = (0.3, 0.6)
PROBLEMS = 10
IN_PROCESSES = 3
"""So many of the problems of each density are solved in processes as well."""
LIMIT = 200_000
"""A run that has sent so many messages is broken off."""
LONGEST_S = 120.0
"""Nor does a run go on for longer."""
METRICS = ("messages", "ncccs", "bytes", "cpu_s")


class Run(NamedTuple):
    """One protocol on one problem.

    `cpu_s`: seconds of the processor in the simulator. `processes_s`: seconds of wall-clock time in processes, from the
    first one's start; 0 if not tried.
    """

    density: float
    problem: int
    protocol: str
    verdict: str
    cost: float
    messages: int
    bytes: int
    ncccs: int
    cpu_s: float
    processes_s: float


def measured() -> Section:
    """All runs; then tables and pictures."""
    runs = [_run(density, problem, name) for density, problem in _problems() for name in PROTOCOLS]
    for density, problem in {(run.density, run.problem) for run in runs}:
        costs = {run.cost for run in runs if run[:2] == (density, problem) and run.verdict != Verdict.UNKNOWN}
        if len(costs) > 1:
            raise FailedError(f"problem {problem} of density {density} has costs {costs}")
    DATA.parent.mkdir(exist_ok=True)
    written_rows(DATA, Run, runs)
    draw("optimum")
    tables = [_table(density, runs) for density in DENSITIES]
    return Section("optimum", "Protocols that minimise, side by side", READING.read_text().strip(), (*tables,))


def _problems() -> Iterator[tuple[float, int]]:
    for problem in range(PROBLEMS):
        say(f"optimum, problem {problem} of each density")
        yield from ((density, problem) for density in DENSITIES)


def _run(density: float, problem: int, name: str) -> Run:
    team = random_csp(AGENTS, DOMAIN, density, 0, problem, connected=True, max_cost=DEAREST)
    team = with_order(team, Order.MAX_DEGREE)
    protocol = protocol_named(name)
    began = time.process_time()
    result = Simulation(team, protocol, Concurrent(problem)).search(LONGEST_S, LIMIT)
    cpu_s = time.process_time() - began
    processes_s = 0.0
    if problem < IN_PROCESSES and result.verdict is Verdict.SOLUTION:
        with ProcessesRun(team, protocol) as session:
            again = session.search(LONGEST_S)
        processes_s = again.metrics.wall_s
        if again.verdict is Verdict.SOLUTION and _cost(team, again) != _cost(team, result):
            raise FailedError(f"{name} on problem {problem} of density {density}: another cost in processes")
    metrics = result.metrics
    figures = sum(metrics.messages.values()), metrics.bytes, metrics.ncccs, round(cpu_s, 4), round(processes_s, 4)
    return Run(density, problem, name, str(result.verdict), _cost(team, result), *figures)


def _cost(team: Team, result: RunResult) -> float:
    """What the robots' values pay; the protocol's own claim plays no part in it."""
    return assignment_cost(team, {name: value for own in result.assignments.values() for name, value in own.items()})


def _table(density: float, runs: Sequence[Run]) -> list[Row]:
    head = (f"density {density:g}", "broken off", *(f"{metric}: median (max)" for metric in METRICS), "in processes, s")
    return [head, *(_row([run for run in runs if run.density == density and run.protocol == n]) for n in PROTOCOLS)]


def _row(runs: Sequence[Run]) -> Row:
    off = sum(run.verdict == Verdict.UNKNOWN for run in runs)
    cells = []
    for metric in METRICS:
        values = [getattr(run, metric) for run in runs]
        digits = 2 if metric == "cpu_s" else 0
        least = ">= " * (off * 2 >= len(runs))
        cells.append(f"{least}{statistics.median(values):,.{digits}f} ({max(values):,.{digits}f})")
    there = [run.processes_s for run in runs if run.processes_s]
    return (runs[0].protocol, str(off), *cells, f"{statistics.median(there):,.2f}" if there else "-")
