"""Part `wide`: the induced width that DPOP solves within a limit of time and memory.

    python benchmarks/wide_tables.py --domain 10 --width 9 [--limit 60] [--set disk=BYTES]

One run in this process, on a complete graph: its induced width is the number of robots less one. Prints JSON: cost,
messages, bytes, CPU seconds, wall seconds, and the peak of memory in MiB; or the reason for a refusal.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from typing import Any

from measure import FailedError, say, timed_command
from report import Row, Section

from robochoc.generators.random_csp import random_csp
from robochoc.run import Options, Runtime, solve
from robochoc.solver.errors import UnsupportedError

FIRST = {3: 17, 5: 12, 10: 8}
"""By domain, the smallest width that is measured; larger ones follow up to the first that is not solved."""
LIMIT_S = 60
MOST_MIB = 4096
STATUS_REFUSED = 3


def measured() -> Section:
    """Return a row for each domain and width."""
    rows: list[Row] = [("domain", "induced width", "cells of a table", "CPU s", "wall s", "peak MiB", "result")]
    for domain, first in FIRST.items():
        width, solved = first, True
        while solved:
            say(f"domain {domain}, width {width}")
            row, solved = _row(domain, width)
            rows.append(row)
            width += 1
    notes = (
        f"`dpop` in the simulator, one process, on complete graphs with random costs from 0 to 9. Limits: {LIMIT_S} s"
        f" of CPU, {MOST_MIB:,} MiB of memory (peak resident set, with the pages of tables on the disk that are in"
        " memory); up to the first width that is not solved. Before tables were joined as integers and kept on the"
        " disk, the largest widths were 17 (10.2 s of CPU), 12 (18.8 s) and 8 (8.5 s); wider teams were refused."
    )
    return Section("wide", "Wide pseudo-trees by DPOP", notes, (rows,))


def _row(domain: int, width: int) -> tuple[Row, bool]:
    command = [sys.executable, __file__, "--domain", str(domain), "--width", str(width), "--limit", str(LIMIT_S)]
    cells = f"{domain**width:,}"
    try:
        sample = timed_command(command, expected=(0, STATUS_REFUSED))
    except FailedError:
        return (str(domain), str(width), cells, f"> {LIMIT_S}", "-", "-", "not in time"), False
    found: dict[str, Any] = sample.answer
    if "refused" in found:
        return (str(domain), str(width), cells, "-", "-", "-", "refused"), False
    in_memory = found["peak_mib"] <= MOST_MIB
    result = f"optimum {found['cost']}" if in_memory else "too much memory"
    times = (f"{found['cpu_s']:.1f}", f"{found['wall_s']:.1f}", f"{found['peak_mib']:,}")
    return (str(domain), str(width), cells, *times, result), in_memory


def main() -> int:
    """Run one case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--domain", type=int, required=True, help="values of each robot")
    parser.add_argument("--width", type=int, required=True, help="induced width")
    parser.add_argument("--limit", type=int, default=LIMIT_S, help="CPU seconds after which the run is killed")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a setting of dpop")
    chosen = parser.parse_args()
    team = random_csp(chosen.width + 1, chosen.domain, 1.0, 0.0, 0, max_cost=9)
    settings = dict(text.split("=", 1) for text in chosen.set)
    before = time.process_time()
    resource.setrlimit(resource.RLIMIT_CPU, (int(before) + chosen.limit, resource.RLIM_INFINITY))
    began = time.perf_counter()
    try:
        outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR, settings=settings))
    except UnsupportedError as error:
        print(json.dumps({"refused": str(error)}))
        return STATUS_REFUSED
    print(json.dumps({
        "cost": outcome.cost, "messages": sum(outcome.metrics.messages.values()), "bytes": outcome.metrics.bytes,
        "cpu_s": time.process_time() - before, "wall_s": time.perf_counter() - began,
        "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }))  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
