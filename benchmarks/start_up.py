"""Part `startup`: how many times the CPU time of importing click and lxml a command takes, from fork to exit.

With `BEFORE=DIR`, another checkout with an environment of its own (`make .venv/.ready` there), its commands are timed
in the same turns.
"""

from __future__ import annotations

import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from urllib.request import urlopen

from measure import ROBOCHOC, ROOT, Sample, say, spread, timed_command
from report import Row, Section

BASE = "import click, lxml.etree"
RUNS = 15
COMMANDS: dict[str, float] = {
    "--help": 1.5,
    "validate instances/queens3d-4": 2,
    "solve instances/queens3d-4": 5,
    "solve instances/queens3d-4 --runtime simulator": 3,
}
"""The commands that are timed, each with the multiple of the base that is aimed at."""
APP = "app, to its first byte"
APP_RUNS = 5


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
    for _ in range(APP_RUNS):
        for when, program in programs.items():
            samples.setdefault((APP, when), []).append(_first_byte(program))
    base = statistics.median(one.cpu_s for one in samples["", "base"])
    rows: list[Row] = [("command", "checkout", "aim", "times the base", "wall s", "CPU s")]
    rows.append((f'python -c "{BASE}"', "", "", "1", *_spent(samples["", "base"])))
    for words, aim in (*COMMANDS.items(), (APP, None)):
        for when in programs:
            taken = samples[words, when]
            times = statistics.median(one.cpu_s for one in taken) / base
            said = "1.2 s" if aim is None else f"at most {aim:g}"
            rows.append((f"robochoc {words}", when, said, f"{times:.2f}", *_spent(taken)))
    notes = (
        "Whole processes, from fork to exit, bytecode written, all commands in turns; ratios of medians of CPU times. "
        "`before` is the checkout that the variable BEFORE names: here the commit before methods of data classes were "
        "compiled on first use. The application is ended after its first byte. Other programs used the machine at the "
        "same time: compare CPU times. Median (min..max)."
    )
    return Section("startup", "Start-up", notes, (rows,))


def _first_byte(program: str) -> Sample:
    """Start the application, and end it when it has sent the first byte of its page."""
    before, began = os.times(), time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "app", "--no-open", "--folder", folder]
        with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
            url = process.stderr.readline().split()[0] if process.stderr else ""
            with urlopen(url) as page:  # noqa: S310 - ours
                page.read(1)
            wall_s = time.perf_counter() - began
            process.send_signal(signal.SIGINT)
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return Sample(wall_s, spent)


def _spent(samples: list[Sample]) -> tuple[str, str]:
    return spread((one.wall_s for one in samples), 3), spread((one.cpu_s for one in samples), 3)
