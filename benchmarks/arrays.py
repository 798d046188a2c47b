"""Measure the runtime of arrays, and how time and memory grow: random graphs, three colours and degree 4 by default.

python benchmarks/arrays.py [--robots N ...] [--protocols NAME ...] [--cycles N] [--degree N] [--values N]
    [--own-tables] [--compiled]

Each row is a process of its own. Times are of its processor (user and system), memory is the most that it had, numpy
and Python included. A cycle: the median of all cycles after the first. `--compiled` compiles and uses the functions
of wheels with a compiled core. The part `arrays` of run.py compares both with arrays_reference.cpp.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from measure import FailedError, say
from report import Row, Section

from robochoc.communication.arrays import compiled
from robochoc.communication.arrays.cycle_run import cycles_of
from robochoc.modelling.array_problem import ArrayProblem

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))
from hatch_build import kernels_library  # noqa: E402 - in the checkout

SIZES = (1_000, 10_000, 100_000, 1_000_000)
WAYS = ("dsa", "dsa, NCCCs not counted", "mgm", "mgm2", "maxsum")
REFERENCE = Path(__file__).with_name("arrays_reference.cpp")
TURNS, TURN_CYCLES = 3, 20


class Case(NamedTuple):
    """Random graphs of one kind. With `own_tables` each edge has random costs, 0 to 99; else equal values cost 1."""

    degree: int
    values: int
    own_tables: bool

    def edges(self, robots: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the edges, drawn uniformly (a pair may be drawn twice), and their tables or table."""
        draw = np.random.default_rng(robots)
        many = self.degree * robots // 2
        first = draw.integers(0, robots, many)
        second = (first + draw.integers(1, robots, many)) % robots
        shape = (many, self.values, self.values)
        tables = draw.integers(0, 100, shape) if self.own_tables else np.eye(self.values, dtype=np.int64)[None]
        return np.column_stack([first, second]), tables


def measured_run(robots: int, case: Case, way: str, cycles: int) -> dict[str, float]:
    """Return the times, the memory and the costs of a run."""
    protocol, _, rest = way.partition(",")
    began = time.process_time()
    edges, tables = case.edges(robots)
    run = ArrayProblem(robots, case.values, edges, tables).run(protocol, ncccs=not rest, cycles=cycles)
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


def measured() -> Section:
    """Compare plain C++, compiled functions and numpy in turns."""
    cases = [(robots, Case(6, 3, own_tables=False)) for robots in SIZES]
    cases += [(SIZES[-1], Case(6, 10, own_tables=False)), (SIZES[-1], Case(6, 3, own_tables=True))]
    head = ("protocol", "robots", "values", "tables", "C++ ms", "compiled ms", "x C++", "set-up s", "numpy ms", "x C++",
            "set-up s")  # fmt: skip
    rows: list[Row] = [head]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        library = kernels_library(ROOT, folder)
        reference = folder / "reference"
        if shutil.which("g++") is None:
            raise FailedError("g++ is missing, which compiles arrays_reference.cpp")
        subprocess.run(["g++", "-O3", "-o", reference, REFERENCE], check=True)
        for robots, case in cases:
            problem = folder / "problem"
            edges, tables = case.edges(robots)
            numbers = [np.array([robots, case.values, len(edges), len(tables)]), edges, tables]
            problem.write_bytes(b"".join(part.astype(np.int32).tobytes() for part in numbers))
            for protocol in ("dsa", "mgm"):
                say(f"{protocol}, {robots:,} robots, {case}")
                rows.append(_row(robots, case, protocol, (reference, problem, library)))
    notes = (
        "DSA and MGM on random graphs of degree 6: a cycle in plain C++ with -O3 and one thread"
        " (`arrays_reference.cpp`, which counts no messages, checks or NCCCs), in arrays with compiled functions, and"
        " in arrays with numpy. CPU milliseconds of the median cycle, and seconds of the set-up,"
        f" which includes the keys of random numbers: the medians of {TURNS} runs, in turns."
    )
    return Section("arrays", "Arrays", notes, (rows,))


def _row(robots: int, case: Case, protocol: str, files: tuple[Path, Path, Path]) -> Row:
    reference, problem, library = files
    found: list[list[dict[str, float]]] = [[], [], []]
    for _ in range(TURNS):
        done = subprocess.run(
            [reference, protocol, str(TURN_CYCLES)], input=problem.read_bytes(), capture_output=True, check=True
        )
        found[0].append(json.loads(done.stdout))
        found[1].append(_run_apart(robots, case, protocol, TURN_CYCLES, library))
        found[2].append(_run_apart(robots, case, protocol, TURN_CYCLES, None))
    floor, fast, slow = (statistics.median(one["cycle_ms"] for one in runs) for runs in found)
    setups = [f"{statistics.median(one['setup_s'] for one in runs):.2f}" for runs in found]
    tables = "one an edge" if case.own_tables else "one"
    cells = (f"{fast:.3f}", f"{fast / floor:.1f}", setups[1], f"{slow:.3f}", f"{slow / floor:.1f}", setups[2])
    return (protocol, f"{robots:,}", str(case.values), tables, f"{floor:.3f}", *cells)


def _run_apart(robots: int, case: Case, way: str, cycles: int, library: Path | None) -> dict[str, float]:
    words = [sys.executable, __file__, "--one", "--robots", str(robots), "--cycles", str(cycles), "--protocols", way]
    words += ["--degree", str(case.degree), "--values", str(case.values), *["--own-tables"] * case.own_tables]
    words += [] if library is None else ["--library", str(library)]
    found: dict[str, float] = json.loads(subprocess.run(words, capture_output=True, check=True, text=True).stdout)
    return found


def main() -> None:
    """Print a table, or with `--one` the figures of one run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, nargs="+", default=SIZES)
    parser.add_argument("--protocols", nargs="+", default=WAYS)
    parser.add_argument("--cycles", type=int, default=20)
    parser.add_argument("--degree", type=int, default=4)
    parser.add_argument("--values", type=int, default=3)
    parser.add_argument("--own-tables", action="store_true", help="random costs for each edge")
    parser.add_argument("--compiled", action="store_true", help="compile and use the functions in C")
    parser.add_argument("--library", help=argparse.SUPPRESS)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    case = Case(given.degree, given.values, given.own_tables)
    if given.one:
        functions = ctypes.CDLL(given.library) if given.library else None
        compiled.compiled_functions = lambda: functions  # type: ignore[assignment]
        print(json.dumps(measured_run(given.robots[0], case, given.protocols[0], given.cycles)))
        return
    with tempfile.TemporaryDirectory() as folder:
        library = kernels_library(ROOT, Path(folder)) if given.compiled else None
        _print_table(given, case, library)


def _print_table(given: argparse.Namespace, case: Case, library: Path | None) -> None:
    print(
        "| protocol | robots | set-up s | ms a cycle | cycles a second | MB | conflicts at first | in the best cycle |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for way in given.protocols:
        for robots in given.robots:
            one = _run_apart(robots, case, way, given.cycles, library)
            print(
                f"| {way} | {robots:,} | {one['setup_s']:.2f} | {one['cycle_ms']:,.2f} | {1e3 / one['cycle_ms']:,.1f} "
                f"| {one['memory_mb']:,.0f} | {one['first']:,.0f} | {one['last']:,.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
