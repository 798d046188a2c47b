"""How time and memory grow with the number of robots.

    python benchmarks/scale.py [--sizes 1000,3000,10000] [--only dsa]

Each run is a process of its own: `robochoc` as a user runs it. CPU seconds (user and system, with children) and the
peak of memory of the process, a row for each graph and stage, a column for each size. Nothing is kept.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from measure import ROOT

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


def measured(words: Sequence[str]) -> tuple[float, float] | None:
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


def main() -> None:
    """Measure all, and print a table in Markdown, row by row."""
    parser = argparse.ArgumentParser(description="How time and memory grow with the number of robots.")
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="numbers of robots")
    parser.add_argument("--only", default="", help="rows with these words alone, and what they need")
    asked = parser.parse_args()
    sizes = [int(size) for size in asked.sizes.split(",")]
    print("| graph | stage |", " | ".join(f"{size:,} robots" for size in sizes), "|")
    print("| --- | --- |", " | ".join("---:" for _ in sizes), "|", flush=True)
    with tempfile.TemporaryDirectory() as place:
        for graph in GRAPHS:
            rows: dict[str, list[str]] = {}
            for size in sizes:
                for name, words in stages(graph, size, Path(place)):
                    if name != "generate" and asked.only not in f"{graph}, {name}":
                        continue
                    found = measured(words)
                    told = f"over {LIMIT_S} s" if found is None else f"{found[0]:.1f} s, {found[1]:,.0f} MB"
                    rows.setdefault(name, ["" for _ in sizes])[sizes.index(size)] = told
            for name, cells in rows.items():
                print(f"| {graph} | {name} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
