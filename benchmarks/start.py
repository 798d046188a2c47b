"""Part `start`: how long it takes until all robots are there."""

from __future__ import annotations

import sys
from pathlib import Path

from measure import repeated, spread, timed_command
from report import Row, Section

ONCE = str(Path(__file__).with_name("start_once.py"))
METHODS = {"fork": (4, 7, 11, 16), "forkserver preload": (4, 7, 11, 16), "forkserver": (4, 11)}
"""Which teams are started by which method; forkserver as it is takes long."""
FLAGSHIP = 11


def measured() -> Section:
    """Time the start of n x n robots by both methods."""
    rows: list[Row] = [("robots", "start method", "aim, s", "all ready, s", "and all gone again, s")]
    rows += [_row(side, method) for method, sides in METHODS.items() for side in sides]
    notes = (
        "Seconds from the beginning of the run until the last robot has confirmed, its problem (3D queens) read and "
        "compiled; then until a run in which nobody says anything is over and all processes have ended. Each start "
        "is in a fresh process, so forkserver includes its server; `preload`: the server imports robochoc once for "
        "all robots, by multiprocessing.set_forkserver_preload. Median (min..max)."
    )
    return Section("start", "Starting robots", notes, (rows,))


def _row(side: int, method: str) -> Row:
    robots = side * side
    samples = repeated(
        f"start {robots} robots by {method}", lambda: timed_command([sys.executable, ONCE, str(side), *method.split()])
    )
    ready, ended = zip(*(map(float, str(sample.output).split()) for sample in samples), strict=True)
    aim = "< 1" if (side, method) == (FLAGSHIP, "fork") else "-"
    return str(robots), method, aim, spread(ready), spread(ended)
