"""Part `solver`: compiling complex robots, robots that fly a row, and the central solver."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from complex_robots import complex_robots
from measure import ROBOCHOC, RUNS, Sample, repeated, spread, timed_command
from report import Row, Section

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d


class Case(NamedTuple):
    """A command on one of the teams, what is wanted of it, and how often it is run."""

    words: tuple[str, ...]
    team: str
    aim: str = "-"
    runs: int = RUNS


CREW = (
    Case(("compile", "--no-cache"), "crew", "< 3"),
    Case(("compile",), "crew", "< 0.3"),
    Case(("solve", "--no-cache"), "crew", "< 3"),
    Case(("solve",), "crew", "< 0.3"),
    Case(("solve", "--no-cache"), "queens3d-7-rows"),
    Case(("solve",), "queens3d-7-rows"),
    Case(("solve", "--no-cache"), "queens3d-11-rows"),
    Case(("solve",), "queens3d-11-rows"),
    Case(("solve", "--runtime", "simulator"), "queens3d-11-rows"),
)
JUDGED = (
    Case(("--protocol", "central", "--count", "--no-cache"), "queens3d-7"),
    Case(("--protocol", "central", "--count", "--no-cache"), "queens3d-11", "2 (purpose-written C++)"),
    Case(("--protocol", "central", "--count"), "queens3d-11", "2 (purpose-written C++)"),
    Case(("--protocol", "central", "--count"), "queens3d-11-full"),
    Case(("--protocol", "central"), "queens3d-12", "40 (purpose-written C++)", 1),
    Case(("--protocol", "central"), "queens3d-12-full", runs=1),
)


def measured() -> Section:
    """Time the commands, from files to exit, with a cache of their own."""
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["XDG_CACHE_HOME"] = str(Path(scratch) / "cache")
        for team in (
            complex_robots(),
            queens3d(7),
            queens3d(7, robots="rows"),
            queens3d(11),
            queens3d(11, robots="rows"),
        ):
            write_team(team, Path(scratch) / team.name)
        for side in (11, 12):
            write_team(queens3d(side, "full"), Path(scratch) / f"queens3d-{side}-full")
        write_team(queens3d(12), Path(scratch) / "queens3d-12")
        local: list[Row] = [("robots", "command", "aim, s", "wall s", "CPU s", "messages", "NCCCs", "MiB a robot")]
        local += [_local_row(case, scratch) for case in CREW]
        judged: list[Row] = [("team", "command", "aim, s", "wall s", "CPU s", "answer")]
        judged += [_judged_row(case, scratch) for case in JUDGED]
    notes = (
        "Whole commands, from fork to exit. `crew`: 16 robots of 5 variables with different private problems. `rows`: "
        "a robot flies a row of the board, 40 (n = 7) and 2,680 (n = 11) local solutions each. Without --no-cache the "
        "local problems are in the cache. MiB a robot: private memory of the largest robot's process at the end."
    )
    return Section("solver", "Complex robots and the central solver", notes, (local, judged))


def _samples(case: Case, words: Sequence[str], scratch: str) -> list[Sample]:
    command = [ROBOCHOC, *words, str(Path(scratch) / case.team), "--json"]
    if "--no-cache" not in words and case.runs > 1:
        timed_command(command)  # fills the cache
    return repeated(f"{case.team}: {' '.join(words)}", lambda: timed_command(command), case.runs)


def _local_row(case: Case, scratch: str) -> Row:
    samples = _samples(case, case.words, scratch)
    answers: list[dict[str, Any]] = [sample.answer for sample in samples]
    counts = ("-", "-", "-")
    if case.words[0] == "solve":
        metrics = [answer["metrics"] for answer in answers]
        memory = "-" if "simulator" in case.words else spread((one["memory"] / 2**20 for one in metrics), 1)
        counts = (spread((m["messages"] for m in metrics), 0), spread((m["ncccs"] for m in metrics), 0), memory)
    return case.team, " ".join(case.words), case.aim, *_times(samples), *counts


def _judged_row(case: Case, scratch: str) -> Row:
    samples = _samples(case, ("solve", *case.words), scratch)
    answer = samples[-1].answer
    found = f"{answer['count']} solutions" if "count" in answer else str(answer["verdict"])
    return case.team, " ".join(case.words), case.aim, *_times(samples), found


def _times(samples: Sequence[Sample]) -> tuple[str, str]:
    return spread(one.wall_s for one in samples), spread(one.cpu_s for one in samples)
