"""Part `messages`: what a message costs: microseconds of CPU in the simulator, by protocol.

By itself it compares checkouts: `python benchmarks/messages.py --tree . --tree OTHER [PROTOCOL...]` takes them in
turns, each run in a process of its own; `pure:DIR` is one without its compiled core.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from measure import ROOT, RUNS, say
from report import Row, Section

PURE = "pure:"
COMPILED = "ROBOCHOC_BENCH_COMPILED"
"""The environment variable with the folder of a compiled robochoc (`site-packages`); without it, only this checkout."""
Problem = Mapping[str, int | float | str]
"""The arguments of `random_csp`, or of `coloring` if there are `colors`, in the order min-width."""
HARD: Problem = {"agents": 20, "domain": 10, "density": 0.25, "tightness": 0.6, "seed": 1, "connected": True}
COSTLY: Problem = {
    "agents": 8, "domain": 4, "density": 0.4, "tightness": 0.0, "seed": 2, "connected": True, "max_cost": 10
}  # fmt: skip
LARGE: Problem = {
    "agents": 100, "domain": 5, "density": 0.04, "tightness": 0.0, "seed": 1, "connected": True, "max_cost": 10
}  # fmt: skip
COLOURED: Problem = {"colors": 3, "degree": 3, "conflicts": "hard"}
SIZES = (64, 256, 1_024, 4_096)
PROBLEMS = {
    "abt": HARD,
    "afc-ng": HARD,
    "adopt": COSTLY,
    "bnb-adopt": COSTLY,
    "sfb": HARD,
    "dpop": COSTLY,
    "dsa": LARGE,
    "mgm": LARGE,
    "mgm2": LARGE,
    "gdba": LARGE,
    "maxsum": LARGE,
    "mb-dpop": COSTLY,
    "o-dpop": COSTLY,
    "adopt-k": COSTLY,
    "syncbb": COSTLY,
    "ncbb": COSTLY,
    "pt-fb": COSTLY,
}
"""The protocols that are measured when none is named, and on what."""
PROGRAM = """
import json, sys, time
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.coloring import coloring
from robochoc.generators.random_csp import random_csp
from robochoc.model.orders import Order, with_order
from robochoc.run.registry import protocol_named
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.agent_problem import RunParameters
protocol = protocol_named(sys.argv[1])
given = json.loads(sys.argv[2])
team = CompiledTeam(with_order(coloring(**given), Order.MIN_WIDTH) if "colors" in given else random_csp(**given))
settings = {"cycles": "20"} if hasattr(protocol.settings, "cycles") else {}
least, began = float("inf"), time.process_time()
while time.process_time() - began < 0.5:
    simulation = Simulation(team, protocol, Concurrent(0), parameters=RunParameters(0, settings))
    before = time.process_time()
    spent = simulation.search(messages=50_000).metrics
    least = min(least, time.process_time() - before)
print(json.dumps([least, sum(spent.messages.values()), spent.ncccs, spent.checks, spent.bytes]))
"""


class Cost(NamedTuple):
    """The CPU seconds of one search, and its counts."""

    cpu_s: float
    messages: int
    ncccs: int
    checks: int
    bytes: int


def cost(protocol: str, tree: str, problem: Problem) -> Cost:
    """Return the cheapest of the searches of half a second, in a process of its own with the code in `tree`."""
    pure = {"ROBOCHOC_PURE": "1"} if tree.startswith(PURE) else {}
    environment = {**os.environ, "PYTHONPATH": str(Path(tree.removeprefix(PURE)).resolve()), **pure}
    command = [sys.executable, "-c", PROGRAM, protocol, json.dumps(problem)]
    done = subprocess.run(
        command, cwd=tree.removeprefix(PURE), env=environment, stdout=subprocess.PIPE, text=True, check=True
    )
    return Cost(*json.loads(done.stdout))


def costs(protocols: Mapping[str, Problem], trees: Sequence[str], runs: int) -> dict[str, list[Cost]]:
    """Return the least cost of each protocol with each tree, of `runs` that are taken in turns."""
    found: dict[str, list[Cost]] = {}
    for protocol, problem in protocols.items():
        say(f"{protocol}, {' and '.join(trees)}")
        taken = [[cost(protocol, tree, problem) for tree in trees] for _ in range(runs)]
        found[protocol] = [min(column) for column in zip(*taken, strict=True)]
    return found


def measured() -> Section:
    """A row for each protocol."""
    notes = (
        "Schedule concurrent, no delays, one process; the search alone, up to 50,000 messages, the least of "
        f"{RUNS} times half a second, plain Python and compiled in turns (`{COMPILED}` is the `site-packages` with the "
        f"wheel). ABT, AFC-ng and SFB: `{_call(HARD)}`. ADOPT, DPOP and the other complete protocols with costs: "
        f"`{_call(COSTLY)}`. DSA, MGM, MGM-2, GDBA, Max-Sum, 20 cycles: `{_call(LARGE)}`. "
        "`python benchmarks/messages.py --tree . --tree OTHER` compares two checkouts. SFB over the size of the team: "
        "3-colouring, hard conflicts, degree 3, order min-width."
    )
    growing = [_table(costs({"sfb": {"agents": size, **COLOURED}}, [str(ROOT)], RUNS), ["us CPU"]) for size in SIZES]
    by_size = [
        ("robots", *growing[0][0][1:]),
        *((f"{n:,}", *rows[1][1:]) for n, rows in zip(SIZES, growing, strict=True)),
    ]
    compiled = os.environ.get(COMPILED)
    trees, heads = ([str(ROOT), compiled], ["us CPU", "compiled"]) if compiled else ([str(ROOT)], ["us CPU"])
    tables = _table(costs(PROBLEMS, trees, RUNS), heads), by_size
    return Section("messages", "What a message costs", notes, tables, ("By protocol", "SFB by the size of the team"))


def _call(problem: Problem) -> str:
    return f"random_csp({', '.join(f'{name}={value}' for name, value in problem.items())})"


def _table(found: Mapping[str, Sequence[Cost]], heads: Sequence[str]) -> list[Row]:
    rows = [
        (
            protocol,
            *(f"{one.cpu_s / one.messages * 1e6:,.1f}" for one in row),
            *(" / ".join(dict.fromkeys(f"{count:,}" for count in column)) for column in zip(*row, strict=True)),
        )
        for protocol, row in ((protocol, row) for protocol, row in found.items())
    ]
    shown = [(*row[: 1 + len(heads)], *row[2 + len(heads) :]) for row in rows]
    return [("protocol", *heads, "messages", "NCCCs", "checks", "bytes"), *shown]


def main() -> None:
    """Compare checkouts, and print a table: microseconds of CPU a message, then the counts (all that differ)."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", help=", ".join(PROBLEMS))
    parser.add_argument("--tree", action="append", metavar="DIR", help="a checkout; repeatable (default: this one)")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--problem", type=json.loads, metavar="JSON", help=f"for all protocols: {json.dumps(HARD)}")
    options = parser.parse_args()
    trees: list[str] = options.tree or [str(ROOT)]
    chosen = {name: options.problem or PROBLEMS.get(name, HARD) for name in options.protocols or PROBLEMS}
    for row in _table(costs(chosen, trees, options.runs), trees):
        print("  ".join(str(cell).rjust(12) for cell in row))


if __name__ == "__main__":
    main()
