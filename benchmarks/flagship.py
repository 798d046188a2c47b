"""Part `flagship`: 3D queens, n = 11, in 121 processes."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from measure import ROBOCHOC, RUNS, Sample, repeated, spread, timed_command
from report import Row, Section

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d

LIMIT_S = 20
UNKNOWN = 3
"""The exit status of a run that reached its time limit."""


class Case(NamedTuple):
    """What is run: the team, how, how often."""

    side: int
    model: str
    runtime: str
    protocol: str = "auto"
    runs: int = RUNS


CASES = (
    Case(11, "planar", "processes"),
    Case(11, "planar", "processes", "abt"),
    Case(11, "full", "processes"),
    Case(11, "full", "processes", "abt"),
    Case(11, "planar", "simulator", runs=1),
    Case(11, "full", "simulator", runs=1),
    Case(7, "full", "processes"),
)


def measured() -> Section:
    """Run every case from a folder of files, through the command line."""
    rows: list[Row] = [("n", "model", "runtime", "protocol", "runs", "verdict", "wall s", "CPU s", "messages", "NCCCs")]
    with tempfile.TemporaryDirectory() as scratch:
        for side, model in sorted({(case.side, case.model) for case in CASES}):
            write_team(queens3d(side, model), _folder(scratch, side, model))
        rows += [_row(case, _folder(scratch, case.side, case.model)) for case in CASES]
    notes = (
        "Whole commands, `robochoc solve FOLDER --json`, from fork to exit; `auto` is the default, "
        "`abt` the paper's protocol. In processes the counts depend on which "
        "robot gets the processor when; in the simulator (schedule concurrent, seed 0) they are exact. "
        f"Time limit {LIMIT_S} s: a case that reaches it has no verdict. Median (min..max)."
    )
    return Section("flagship", "3D queens with 121 robots", notes, (rows,))


def _folder(scratch: str, side: int, model: str) -> Path:
    return Path(scratch) / f"queens3d-{side}-{model}"


def _row(case: Case, folder: Path) -> Row:
    command = [ROBOCHOC, "solve", str(folder), "--json", "--runtime", case.runtime, "--protocol", case.protocol]
    command += ["--timeout", str(LIMIT_S)]
    samples = repeated(
        f"queens3d n = {case.side} {case.model}, {case.runtime}, {case.protocol}",
        lambda: timed_command(command, expected=(0, UNKNOWN)),
        case.runs,
    )
    results: list[dict[str, Any]] = [sample.answer for sample in samples]
    counts = (spread((result["metrics"][what] for result in results), 0) for what in ("messages", "ncccs"))
    said = str(case.side), case.model, case.runtime, case.protocol, str(case.runs), _verdicts(results)
    return *said, *_times(samples), *counts


def _verdicts(results: Sequence[dict[str, Any]]) -> str:
    found = [str(result["verdict"]) for result in results]
    return ", ".join(f"{found.count(verdict)} {verdict}" for verdict in sorted(set(found)))


def _times(samples: Sequence[Sample]) -> tuple[str, str]:
    return spread(one.wall_s for one in samples), spread(one.cpu_s for one in samples)
