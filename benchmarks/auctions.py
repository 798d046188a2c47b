"""Part `auctions`: how close auctions come to the optimum, and what large teams take.

With `BEFORE=DIR`, another checkout, its commands are timed as well: by this Python, with that checkout's code.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from statistics import mean

from measure import ROOT, Sample, say, timed_command
from report import Row, Section

from robochoc.formats import write_team
from robochoc.generators.tasks import tasks
from robochoc.model.allocation import TasksModel
from robochoc.run import Options, Runtime, solve

PROBLEMS = 200
ROBOTS = TASKS = 5
AUCTIONS = ("ssi", "cbaa", "cbba")
SIZES = (20, 80, 200)
LIMIT_S = 200


def measured() -> Section:
    """Compare the auctions with DPOP's optimum; then time them on teams of as many robots as tasks."""
    notes = (
        f"Shares of the optimum (DPOP's) of the tasks' worth less the ways: {PROBLEMS} problems of each model, "
        f"`robochoc generate tasks --agents {ROBOTS} --tasks {TASKS} --seed 1` to {PROBLEMS}. Then whole commands, "
        "`robochoc solve TEAM --protocol P --runtime simulator`, TEAM being a robot for each task (assignment, seed "
        f"1), of {LIMIT_S} seconds at most."
    )
    captions = ("Beside the optimum", "Large teams")
    return Section("auctions", "Auctions", notes, ([*_shares()], [*_times()]), captions)


def _shares() -> Iterator[Row]:
    yield "model", "protocol", "mean share", "worst share", "optimal in", "messages, mean", "bytes, mean"
    for model in TasksModel:
        say(f"{model}")
        teams = [tasks(ROBOTS, TASKS, seed=seed, model=model) for seed in range(1, PROBLEMS + 1)]
        best: list[float] = []
        for protocol in ("dpop", *AUCTIONS):
            outcomes = [
                solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, cache=False)) for team in teams
            ]
            gains = [float(one.cost or 0) for one in outcomes]
            best = best or gains
            shares = [gain / most if most else 1 for gain, most in zip(gains, best, strict=True)]
            yield (
                str(model),
                protocol,
                f"{mean(shares):.1%}",
                f"{min(shares):.0%}",
                f"{sum(share == 1 for share in shares)} of {PROBLEMS}",
                f"{mean(sum(one.metrics.messages.values()) for one in outcomes):,.0f}",
                f"{mean(one.metrics.bytes for one in outcomes):,.0f}",
            )


def _times() -> Iterator[Row]:
    yield "robots and tasks", "protocol", "checkout", "CPU s", "messages", "bytes"
    checkouts = {"now": ROOT}
    if before := os.environ.get("BEFORE"):
        checkouts = {"before": Path(before).resolve(), **checkouts}
    with tempfile.TemporaryDirectory() as scratch:
        for size in SIZES:
            folder = Path(scratch) / str(size)
            write_team(tasks(size, size, seed=1), folder)
            for protocol in ("ssi", "cbba"):
                for when, checkout in checkouts.items():
                    say(f"{size} robots, {protocol}, {when}")
                    yield str(size), protocol, when, *_cells(_timed(checkout, folder, protocol))


def _timed(checkout: Path, folder: Path, protocol: str) -> Sample:
    words = ["solve", str(folder), "--protocol", protocol, "--runtime", "simulator", "--json"]
    command = ["env", f"PYTHONPATH={checkout}", sys.executable, "-P", "-m", "robochoc", *words]
    return timed_command(command, limit_s=LIMIT_S)


def _cells(taken: Sample) -> Row:
    if taken.output is None:
        return f"not within {LIMIT_S} s", "-", "-"
    result = json.loads(taken.output)
    metrics = result["metrics"]
    return f"{taken.cpu_s:.1f}", f"{metrics['messages']:,}", f"{metrics['bytes']:,}"
