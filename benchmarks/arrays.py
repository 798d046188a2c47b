"""Measure the runtime of arrays, and how time and memory grow: random graphs of degree 4, three colours.

python benchmarks/arrays.py [--robots N ...] [--protocols NAME ...] [--cycles N] [--own-tables]

Each row is a process of its own. Times are of its processor (user and system), memory is the most that it had, numpy
and Python included. A cycle: the median of all cycles after the first.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time

import numpy as np

from robochoc.communication.arrays.cycle_run import cycles_of
from robochoc.modelling.array_problem import ArrayProblem

SIZES = (1_000, 10_000, 100_000, 1_000_000)
WAYS = ("dsa", "dsa, NCCCs not counted", "mgm", "mgm2", "maxsum")
COLOURS, HALF_DEGREE = 3, 2


def problem(robots: int, *, own_tables: bool) -> ArrayProblem:
    """Return a colouring problem: 2 edges a robot, drawn uniformly; a pair may be drawn twice.

    With `own_tables` each edge has random costs instead, 0 to 99.
    """
    draw = np.random.default_rng(robots)
    first = draw.integers(0, robots, HALF_DEGREE * robots)
    second = (first + draw.integers(1, robots, HALF_DEGREE * robots)) % robots
    tables = draw.integers(0, 100, (len(first), COLOURS, COLOURS)) if own_tables else np.eye(COLOURS)
    return ArrayProblem(robots, COLOURS, np.column_stack([first, second]), tables)


def measured(robots: int, way: str, cycles: int, *, own_tables: bool) -> dict[str, float]:
    """Return what a run takes."""
    protocol, _, rest = way.partition(",")
    began = time.process_time()
    made = problem(robots, own_tables=own_tables)
    run = made.run(protocol, ncccs=not rest, cycles=cycles)
    times = []
    before = time.process_time()
    setup_s = before - began
    for _ in cycles_of(run):
        now = time.process_time()
        times.append(now - before)
        before = now
    return {
        "setup_s": setup_s,
        "cycle_ms": 1e3 * statistics.median(times[2:] or times[1:]),
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "first": run.costs[0],
        "last": min(run.costs),
    }


def main() -> None:
    """Print a table, or with `--one` the figures of one run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, nargs="+", default=SIZES)
    parser.add_argument("--protocols", nargs="+", default=WAYS)
    parser.add_argument("--cycles", type=int, default=20)
    parser.add_argument("--own-tables", action="store_true", help="random costs for each edge")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(measured(given.robots[0], given.protocols[0], given.cycles, own_tables=given.own_tables)))
        return
    print(
        "| protocol | robots | set-up s | ms a cycle | cycles a second | MB | conflicts at first | in the best cycle |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for way in given.protocols:
        for robots in given.robots:
            words = [sys.executable, __file__, "--one", "--robots", str(robots), "--cycles", str(given.cycles)]
            words += ["--own-tables"] * given.own_tables
            done = subprocess.run([*words, "--protocols", way], capture_output=True, check=True, text=True)
            one = json.loads(done.stdout)
            print(
                f"| {way} | {robots:,} | {one['setup_s']:.2f} | {one['cycle_ms']:,.2f} | {1e3 / one['cycle_ms']:,.1f} "
                f"| {one['memory_mb']:,.0f} | {one['first']:,.0f} | {one['last']:,.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
