"""Part `cluster`: arrays on the workers of a Dask cluster on this machine: overhead a cycle, and memory.

    python benchmarks/array_cluster.py --robots 100000 --workers 2 [--graph random] [--protocol mgm] [--cycles N]

One case. It prints JSON: milliseconds of CPU a cycle in all workers together, and of wall time; the peak of memory of
the largest worker and of the client, and of a worker without robots, in MB. Without `--workers`: in this process. The
time of a cycle is the difference between runs of 1 and of N + 1 cycles, divided by N, after a run that imports all.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from typing import Any

import numpy as np
from distributed import Client, LocalCluster
from measure import say, timed_command
from report import Row, Section

from robochoc.modelling.array_problem import ArrayProblem

COLOURS = 3
SIZES = {1_000: 100, 200_000: 20}
"""The numbers of robots, with the numbers of cycles."""
CASES = (("grid", "dsa", 0), ("grid", "dsa", 2), ("random", "dsa", 2), ("grid", "dsa", 4))
"""Graph, protocol, and number of workers."""


def measured() -> Section:
    """Return a row for each case and size."""
    rows: list[Row] = [
        ("graph", "protocol", "workers", "robots", "CPU ms a cycle", "wall ms a cycle", "MB a worker", "MB client")
    ]
    empty_mb = 0.0
    for graph, protocol, workers in CASES:
        for robots, cycles in SIZES.items():
            say(f"{graph}, {protocol}, {workers} workers, {robots} robots")
            words = ["--graph", graph, "--protocol", protocol, "--workers", str(workers), "--robots", str(robots)]
            found: dict[str, Any] = timed_command([sys.executable, __file__, *words, "--cycles", str(cycles)]).answer
            memory = f"{found['worker_mb']:,.0f}" if workers else "-"
            empty_mb = found.get("empty_mb", empty_mb)
            rows.append((
                graph, protocol, str(workers or "none"), f"{robots:,}", f"{found['cpu_ms']:,.2f}",
                f"{found['wall_ms']:,.2f}", memory, f"{found['client_mb']:,.0f}",
            ))  # fmt: skip
    notes = (
        "`ArrayProblem.solve(cluster=...)` with three colours, degree 4, and one thread a worker. `grid`: a torus of"
        " 100 rows, so blocks have few neighbours; `random`: edges drawn uniformly, so most robots have neighbours in"
        " the other block. CPU is of all workers; without workers, of this process. Wall time depends on the load of"
        f" the machine, which has 2 cores. A worker without robots takes {empty_mb:.0f} MB."
    )
    return Section("cluster", "Arrays on a Dask cluster", notes, (rows,))


def problem(robots: int, graph: str) -> ArrayProblem:
    """Return a colouring problem on a torus with 100 rows, or on a random graph."""
    first = np.concatenate([np.arange(robots)] * 2)
    draw = np.random.default_rng(robots)
    steps = np.repeat([1, robots // 100], robots) if graph == "grid" else draw.integers(1, robots, 2 * robots)
    return ArrayProblem(robots, COLOURS, np.column_stack([first, (first + steps) % robots]), np.eye(COLOURS))


def used() -> tuple[float, float]:
    """Return this process's CPU seconds, and its peak of memory in MB."""
    figures = resource.getrusage(resource.RUSAGE_SELF)
    return figures.ru_utime + figures.ru_stime, figures.ru_maxrss / 1024


def case(given: argparse.Namespace) -> dict[str, float]:
    """Measure one case."""
    if not given.workers:
        _, *times = [_solve(given, cycles, None) for cycles in (1, 1, given.cycles + 1)]
        return _figures(times, given.cycles) | {"client_mb": used()[1]}
    with (
        LocalCluster(n_workers=given.workers, threads_per_worker=1, memory_limit=0, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        empty = max(mb for _, mb in client.run(used).values())
        times = []
        for cycles in (1, 1, given.cycles + 1):
            before = sum(cpu for cpu, _ in client.run(used).values())
            _, wall_s = _solve(given, cycles, cluster.scheduler_address)
            times.append((sum(cpu for cpu, _ in client.run(used).values()) - before, wall_s))
        worker = max(mb for _, mb in client.run(used).values())
    return _figures(times[1:], given.cycles) | {"worker_mb": worker, "empty_mb": empty, "client_mb": used()[1]}


def _solve(given: argparse.Namespace, cycles: int, cluster: str | None) -> tuple[float, float]:
    """Return the seconds of CPU, and of wall time, that a run takes in this process."""
    before, began = time.process_time(), time.perf_counter()
    problem(given.robots, given.graph).solve(given.protocol, cycles=cycles, cluster=cluster)
    return time.process_time() - before, time.perf_counter() - began


def _figures(times: list[tuple[float, float]], cycles: int) -> dict[str, float]:
    (cpu, wall), (more_cpu, more_wall) = times
    return {"cpu_ms": 1e3 * (more_cpu - cpu) / cycles, "wall_ms": 1e3 * (more_wall - wall) / cycles, "setup_s": cpu}


def main() -> None:
    """Run one case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, required=True)
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--graph", choices=("grid", "random"), default="grid")
    parser.add_argument("--protocol", default="dsa")
    parser.add_argument("--cycles", type=int, default=20)
    print(json.dumps(case(parser.parse_args())))


if __name__ == "__main__":
    main()
