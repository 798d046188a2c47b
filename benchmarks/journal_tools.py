"""Part `journal_tools`: CPU time and memory of the sniffer and of `robochoc journal` for a million messages."""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from measure import ROBOCHOC, ROOT, say
from report import Row, Section

MESSAGES = 1_000_000
STATES = 64
_EXPORTS = (("show",), ("export", "--format", "jsonl"))


def measured() -> Section:
    """Measure each tool in a process of its own."""
    notes = (
        f"ABT on queens3d n = 8 in the simulator, stopped after {MESSAGES:,} messages, with `--journal`. CPU seconds "
        "of a process, once each, and its peak memory. The sniffer's rows are of its server without a browser: reading "
        "the journal, a search of all messages, and the states of the robot with the most steps, in chunks of "
        f"{STATES} steps, in this order. Before (commit 005e4865), `show` needed 727 MB, `export --format jsonl` "
        "1,447 MB, and the last chunk of states 8.5 s each time. The search took place in the browser, chunk by chunk."
    )
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "run.journal"
        team = Path(scratch) / "team"
        say("a long journal")
        _run(ROBOCHOC, "generate", "queens3d", "--n", "8", "-o", str(team))
        limit = ("--messages", str(MESSAGES))
        _run(
            ROBOCHOC, "solve", str(team), "--protocol", "abt", "--runtime", "simulator", *limit, "--journal", str(path)
        )
        rows: list[Row] = [("tool", "CPU s", "peak MB"), *_rows(path)]
    return Section("journal_tools", "Tools for long journals", notes, (rows,))


def _rows(path: Path) -> list[Row]:
    say("the sniffer")
    done = subprocess.run([sys.executable, __file__, str(path)], check=True, capture_output=True, text=True)
    rows: list[Row] = [(name, f"{cpu_s:.2f}", f"{peak:,.0f}") for name, cpu_s, peak in json.loads(done.stdout)]
    for words in _EXPORTS:
        say(" ".join(words))
        code = (
            "import resource, subprocess, sys; subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True); "
            "used = resource.getrusage(resource.RUSAGE_CHILDREN); print(used.ru_utime + used.ru_stime, used.ru_maxrss)"
        )
        command = [sys.executable, "-c", code, ROBOCHOC, "journal", words[0], str(path), *words[1:]]
        cpu_s, peak = map(float, subprocess.run(command, check=True, capture_output=True, text=True).stdout.split())
        rows.append((f"`journal {' '.join(words)}`", f"{cpu_s:.2f}", f"{peak / 1024:,.0f}"))
    return rows


def _run(*command: str) -> None:
    subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)  # unknown: 3


def _sniffer(path: Path) -> list[tuple[str, float, float]]:
    """Return the steps of a session with their CPU seconds, and the peak memory so far in MB."""
    from robochoc.sniffer.session import SnifferSession  # noqa: PLC0415 - only in the measured process

    os.utime(path, (0, 0))  # nobody writes it
    session = SnifferSession(path)
    found: list[tuple[str, float, float]] = []

    def timed(name: str, act: Callable[[], Any]) -> None:
        began = time.process_time()
        act()
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        found.append((name, time.process_time() - began, peak))

    timed("the sniffer reads the journal", lambda: _read(session))
    timed("a search", lambda: _search(session))
    trace = session._trace  # noqa: SLF001 - there is no need for a public name
    robot, steps = Counter(trace.steps.robot).most_common(1)[0]
    name, last = trace.robots[robot], (steps - 1) // STATES
    for words, chunk in (("the last", last), ("the one before", last - 1), ("half-way", last // 2)):
        timed(f"{words} of {last + 1} chunks of states", partial(session.states, name, chunk))
    return found


def _read(session: Any) -> None:  # noqa: ANN401 - imported late
    while session.advance():
        pass


def _search(session: Any) -> None:  # noqa: ANN401 - imported late
    count, first = session.news()["messages"], 0
    while first < count:
        first = json.loads(session.search("cannot", first, count))["to"]


def main() -> None:
    """Measure the sniffer in this process, and print the rows as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("journal", type=Path, metavar="JOURNAL")
    print(json.dumps(_sniffer(parser.parse_args().journal)))


if __name__ == "__main__":
    main()
