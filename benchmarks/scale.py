"""Part `growth`: how the CPU time of each stage of a run grows with the number of robots.

    python benchmarks/scale.py [--sizes 1000,3000,10000] [--only dsa]

measures whole commands instead. Each run is a process of its own: `robochoc` as a user runs it. CPU seconds (user and
system, with children) and the peak of memory of the process, a row for each graph and stage, a column for each size.
Nothing is kept.
"""

# ruff: noqa: PLC0415 - the peak of memory of a command is at least that of this process, which must stay small
from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from measure import ROOT, say
from report import Row, Section

SIZES = (1_000, 3_000, 10_000)
CYCLES = 20
LONG_MAX = 1_000
"""The most robots for runs of 200 cycles."""
GRAPHS = {
    "random, degree 4": ("--degree", "4"),
    "tree": ("--graph", "tree"),
    "ring": ("--graph", "small-world", "--neighbours", "2", "--rewiring", "0"),
    "tree, hard": ("--graph", "tree", "--conflicts", "hard"),
}
LOCAL = tuple((name, ("--protocol", name, "--set", f"cycles={CYCLES}")) for name in ("dsa", "mgm", "maxsum"))
SOLVED: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "random, degree 4": LOCAL,
    "tree": (("dpop", ("--protocol", "dpop")),),
    "ring": (("dsa", LOCAL[0][1]), ("dpop", ("--protocol", "dpop"))),
    "tree, hard": (("abt", ("--protocol", "abt")), ("afc-ng", ("--protocol", "afc-ng"))),
}
LIMIT_S = 900


def stages(graph: str, size: int, folder: Path) -> Iterator[tuple[str, Sequence[str]]]:
    """Yield the name and the words of each command, in the order in which they have to run."""
    team, page = str(folder / "team"), str(folder / "page.html")
    yield "generate", ("generate", "coloring", "--agents", str(size), *GRAPHS[graph], "-o", team, "--force")
    yield "validate", ("validate", team)
    simulator = ("solve", team, "--runtime", "simulator")
    for name, options in SOLVED[graph]:
        yield f"solve, {name}", (*simulator, *options, "--json")
    if size <= LONG_MAX and graph == "random, degree 4":
        for name, _ in LOCAL:
            yield f"solve, {name}, 200 cycles", (*simulator, "--protocol", name, "--set", "cycles=200", "--json")
    if graph == "ring":
        yield "solve, dsa, 1 cycle", (*simulator, "--protocol", "dsa", "--set", "cycles=1")
        yield "the same, as JSON", (*simulator, "--protocol", "dsa", "--set", "cycles=1", "--json")
        yield "the same, and a page", (*simulator, "--protocol", "dsa", "--set", "cycles=1", "--html", page)


def cost_of(words: Sequence[str]) -> tuple[float, float] | None:
    """Return CPU seconds and the peak of memory in MB of one run of the program; None: it took too long."""
    command = ["timeout", str(LIMIT_S), sys.executable, "-m", "robochoc", *words]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode == 124:
        return None
    if process.returncode:
        raise SystemExit(f"{' '.join(words)} ended with status {process.returncode}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


GROWING = (64, 256, 1_024, 4_096)
STAGES = ("read", "validate", "compile", "search", "check", "report", "journal", "page", "messages")
TREES = ("abt", "afc-ng", "sfb", "dpop")
PROTOCOLS = (*TREES, "mgm")
Result = TypeVar("Result")


def measured() -> Section:
    """Measure the stages for each protocol and size, and fit the exponents."""
    rows: list[Row] = [
        ("protocol", "stage", *(f"{size:,} robots" for size in GROWING), "exponent", f"from {GROWING[1]}")
    ]
    for protocol in PROTOCOLS:
        taken = [_cost_of_stages(protocol, size) for size in GROWING]
        for number, stage in enumerate(STAGES):
            values = [one[number] for one in taken]
            shown = [f"{value:,.0f}" if stage == "messages" else f"{1000 * value:,.1f}" for value in values]
            exponents = [exponent(GROWING[first:], values[first:]) for first in (0, 1)]
            rows.append((protocol, stage, *shown, *(f"{one:.2f}" for one in exponents)))
    notes = (
        "CPU milliseconds of each stage in one process without its start, one run each. Graph colouring with "
        "3 colours: trees with hard conflicts for ABT, AFC-ng and SFB, trees with costs for DPOP, random graphs of "
        "degree 4 with costs and 20 cycles for MGM. read: the files; validate: the same team as objects; compile: in "
        "the order min-width; search: with the preparation of the robots, in the simulator; check: the answer against "
        "the files; report: the text; journal: the whole run, message by message, with a journal; page: the scene as "
        f"a page. Exponent: the slope of log CPU over log robots, over all sizes, and from {GROWING[1]} robots on."
    )
    return Section("growth", "Growth with the team", notes, (rows,))


def exponent(sizes: Sequence[int], values: Sequence[float]) -> float:
    """Return the slope of the logarithms of `values` over those of `sizes`."""
    return statistics.linear_regression([math.log(size) for size in sizes], [math.log(one) for one in values]).slope


def _cost_of_stages(protocol: str, size: int) -> list[float]:
    say(f"{protocol}, {size} robots")
    command = [sys.executable, __file__, "--stages", protocol, "--sizes", str(size)]
    found: list[float] = json.loads(subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True).stdout)
    return found


def cpu_of_stages(protocol: str, size: int) -> list[float]:
    """Return the CPU seconds of each stage, and the number of messages, in the order of `STAGES`."""
    from robochoc.cli.reports.outcome import outcome_report
    from robochoc.cli.reports.scene import scene_for
    from robochoc.formats import read_team, write_team
    from robochoc.formats.validation import check_team
    from robochoc.generators.coloring import Conflicts, coloring_of
    from robochoc.generators.graphs import tree, uniform
    from robochoc.journal.recorder import recorded
    from robochoc.model.orders import Order, with_order
    from robochoc.run import Options, Runtime, solve
    from robochoc.run.evaluation import check_with_files
    from robochoc.run.phases import first_phase
    from robochoc.run.recording import journal_header, objective_to_record
    from robochoc.run.registry import protocol_named
    from robochoc.run.runtimes import SessionRequest, open_session
    from robochoc.solver.compile import TeamCompiler
    from robochoc.view.page import scene_page

    spent: list[float] = []

    def timed(act: Callable[[], Result]) -> Result:
        before = time.process_time()
        result = act()
        spent.append(time.process_time() - before)
        return result

    conflicts = Conflicts.SOFT if protocol in {"dpop", "mgm"} else Conflicts.HARD
    graph = tree(size) if protocol in TREES else uniform(size, 2 * size, "")
    settings = {} if protocol in TREES else {"cycles": str(CYCLES)}
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, settings=settings, order=Order.MIN_WIDTH)
    phase = first_phase(options, protocol_named(protocol), lambda: 0)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "team"
        write_team(coloring_of(graph, 3, conflicts=conflicts), folder)
        team = timed(lambda: read_team(folder))
        timed(lambda: check_team(replace(team)))
        ordered = with_order(team, Order.MIN_WIDTH)
        compiled = timed(lambda: TeamCompiler(None, None, None, None, None).compile(ordered))
        request = SessionRequest(phase.protocol, compiled, phase.parameters, options)
        result = timed(lambda: open_session(request).search())
        timed(lambda: check_with_files(phase, result, team, compiled))
        with recorded(
            Path(place) / "journal", journal_header(team, options), objective_to_record(team, options)
        ) as recorder:
            before = time.process_time()
            outcome = solve(team, options, observer=recorder)
            recorder.close()
            journal = time.process_time() - before
        timed(lambda: outcome_report(team, outcome))
        timed(lambda: scene_page(scene_for(outcome, team)))
    spent.insert(-1, journal)
    return [*spent, float(sum(result.metrics.messages.values()))]


def main() -> None:
    """Measure all, and print a table in Markdown, row by row."""
    parser = argparse.ArgumentParser(description="How time and memory grow with the number of robots.")
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="numbers of robots")
    parser.add_argument("--stages", default="", help="a protocol: print the CPU seconds of each stage instead")
    parser.add_argument("--only", default="", help="rows with these words alone, and what they need")
    asked = parser.parse_args()
    sizes = [int(size) for size in asked.sizes.split(",")]
    if asked.stages:
        cpu_of_stages(asked.stages, 8)  # imports
        print(json.dumps(cpu_of_stages(asked.stages, sizes[0])))
        return
    print("| graph | stage |", " | ".join(f"{size:,} robots" for size in sizes), "|")
    print("| --- | --- |", " | ".join("---:" for _ in sizes), "|", flush=True)
    with tempfile.TemporaryDirectory() as place:
        for graph in GRAPHS:
            rows: dict[str, list[str]] = {}
            for size in sizes:
                for name, words in stages(graph, size, Path(place)):
                    if name != "generate" and asked.only not in f"{graph}, {name}":
                        continue
                    found = cost_of(words)
                    told = f"over {LIMIT_S} s" if found is None else f"{found[0]:.1f} s, {found[1]:,.0f} MB"
                    rows.setdefault(name, ["" for _ in sizes])[sizes.index(size)] = told
            for name, cells in rows.items():
                print(f"| {graph} | {name} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
