"""Part `startup`: how many times as long as importing click and lxml a command takes, from fork to exit.

With `BEFORE=DIR`, another checkout with an environment of its own (`make .venv/.ready` there), its commands are timed
in the same turns.
"""

from __future__ import annotations

import os
import statistics
import sys
from pathlib import Path

from measure import ROBOCHOC, Sample, say, spread, timed_command
from report import Row, Section

BASE = "import click, lxml.etree"
RUNS = 15
COMMANDS: dict[str, float | None] = {
    "--help": 1.5,
    "validate instances/queens3d-4": 3,
    "solve instances/queens3d-4": 5,
    "solve instances/queens3d-4 --runtime simulator": None,
}
"""The commands that are timed, each with the multiple of the base that is aimed at (None: no aim)."""


def measured() -> Section:
    """Time all commands of all checkouts in turns."""
    programs = {"now": ROBOCHOC}
    if before := os.environ.get("BEFORE"):
        programs = {"before": str(Path(before).resolve() / ".venv/bin/robochoc"), **programs}
    commands = {("", "base"): [sys.executable, "-c", BASE]}
    commands |= {(words, when): [program, *words.split()] for words in COMMANDS for when, program in programs.items()}
    say(f"{len(commands)} commands in turns, {RUNS} times")
    for command in commands.values():
        timed_command(command)  # bytecode is written
    samples: dict[tuple[str, str], list[Sample]] = {key: [] for key in commands}
    for _ in range(RUNS):
        for key, command in commands.items():
            samples[key].append(timed_command(command))
    base = statistics.median(one.wall_s for one in samples["", "base"])
    rows: list[Row] = [("command", "checkout", "aim", "times the base", "wall s", "CPU s")]
    rows.append((f'python -c "{BASE}"', "", "", "1", *_spent(samples["", "base"])))
    for words, aim in COMMANDS.items():
        for when in programs:
            taken = samples[words, when]
            times = statistics.median(one.wall_s for one in taken) / base
            said = "-" if aim is None else f"at most {aim:g}"
            rows.append((f"robochoc {words}", when, said, f"{times:.2f}", *_spent(taken)))
    notes = (
        "Whole processes, from fork to exit, bytecode written, all commands in turns; ratios of medians. `before` is "
        "the checkout that the variable BEFORE names: here the commit before small runs stopped to import what they "
        "have no use for. Median (min..max)."
    )
    return Section("startup", "Start-up", notes, (rows,))


def _spent(samples: list[Sample]) -> tuple[str, str]:
    return spread((one.wall_s for one in samples), 3), spread((one.cpu_s for one in samples), 3)
