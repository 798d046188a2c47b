"""Part `crowd`: 1,000 robots as processes: what they take to start, to solve an easy problem, and to end.

With `BEFORE=DIR`, another checkout, its command is run in the same turns: by this Python, with that checkout's code.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from measure import ROOT, FailedError, Sample, say, spread, timed_command
from report import Row, Section

from robochoc.formats import write_team
from robochoc.generators.coloring import Conflicts, coloring

ROBOTS = (250, 1000)
TURNS = 3
LOOK_S = 0.5
"""Seconds between two looks at the memory of all processes."""
_WORDS = ("--protocol", "abt", "--runtime", "processes")


def measured() -> Section:
    """Time each team in turns; then run it once more, and look at its memory."""
    checkouts = {"now": ROOT}
    if before := os.environ.get("BEFORE"):
        checkouts = {"before": Path(before).resolve(), **checkouts}
    rows: list[Row] = [("robots", "checkout", "wall s", "CPU s", "CPU ms a robot", "memory, MB", "kB a robot")]
    with tempfile.TemporaryDirectory() as scratch:
        for robots in ROBOTS:
            folder = Path(scratch) / str(robots)
            write_team(coloring(robots, 4, 3, conflicts=Conflicts.HARD), folder)
            rows += _rows(robots, folder, checkouts)
    notes = (
        "Whole commands, from fork to exit: `robochoc solve TEAM --protocol abt`, TEAM being a graph colouring (4 "
        "colours, degree 3, hard conflicts, seed 0) that ABT solves in some 2,000 messages. Memory: the largest sum "
        "over all processes, shared pages in parts (PSS), in a run of its own. Median (min..max) of "
        f"{TURNS} rounds in turns."
    )
    return Section("crowd", "A thousand processes", notes, (rows,))


def _rows(robots: int, folder: Path, checkouts: dict[str, Path]) -> Iterator[Row]:
    samples: dict[str, list[Sample]] = {when: [] for when in checkouts}
    for turn in range(1, TURNS + 1):
        say(f"{robots} robots, round {turn}")
        for when, checkout in checkouts.items():
            samples[when].append(timed_command(_command(checkout, folder)))
    for when, checkout in checkouts.items():
        memory = max(_memories(_command(checkout, folder)))
        taken = samples[when]
        yield (
            str(robots),
            when,
            spread(one.wall_s for one in taken),
            spread(one.cpu_s for one in taken),
            spread((one.cpu_s * 1000 / robots for one in taken), 1),
            f"{memory / 1e6:,.0f}",
            f"{memory / 1e3 / robots:,.0f}",
        )


def _command(checkout: Path, folder: Path) -> list[str]:
    return ["env", f"PYTHONPATH={checkout}", sys.executable, "-P", "-m", "robochoc", "solve", str(folder), *_WORDS]


def _memories(command: list[str]) -> Iterator[int]:
    """Run the command, and yield the memory of all its processes now and then, in bytes."""
    yield 0
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as process:
        while process.poll() is None:
            time.sleep(LOOK_S)
            yield sum(map(_pss, _family(process.pid)))
    if process.returncode:
        raise FailedError(f"{' '.join(command)} ended with status {process.returncode}")


def _family(pid: int) -> Iterator[int]:
    yield pid
    for child in _read(f"/proc/{pid}/task/{pid}/children").split():
        yield from _family(int(child))


def _pss(pid: int) -> int:
    lines = _read(f"/proc/{pid}/smaps_rollup").splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) * 1024


def _read(file: str) -> str:
    try:
        return Path(file).read_text()
    except OSError:  # the process has ended
        return ""
