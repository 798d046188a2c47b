"""Part `whole`: what a user waits for, from the shell's fork to the exit of the command."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from colouring import AGENTS, EDGES, SEED, colouring
from measure import ROBOCHOC, repeated, spread, timed_command
from report import Row, Section

from robochoc.formats import write_team


def measured() -> Section:
    """Time every command."""
    with tempfile.TemporaryDirectory() as scratch:
        graph = Path(scratch) / f"colouring-{AGENTS}"
        write_team(colouring(), graph)
        rows = [_row(words, aim, str(graph)) for words, aim in _commands()]
    notes = (
        "Whole-process wall time, from fork to exit, interpreter start and imports included; CPU is of the command "
        f"and all its robots. GRAPH is a random 3-colouring problem: {AGENTS} robots, {EDGES} edges, seed {SEED}. "
        "Other libraries are measured in part `peers`. Median (min..max)."
    )
    return Section("whole", "A command from fork to exit", notes, (_HEAD + rows,))


_HEAD: list[Row] = [("command", "aim, wall s", "wall s", "CPU s")]


def _commands() -> list[tuple[str, str]]:
    """What is timed, and what we aim at."""
    return [
        ("python -c pass", "(baseline)"),
        ("robochoc --help", "< 0.12"),
        ("robochoc validate instances/queens3d-4", "-"),
        ("robochoc solve instances/queens3d-4", "< 0.6"),
        ("robochoc solve instances/queens3d-4 --runtime simulator", "-"),
        ("robochoc solve instances/queens3d-7", "-"),
        ("robochoc solve GRAPH", "< the peers'"),
        ("robochoc solve GRAPH --runtime simulator", "< the peers'"),
    ]


def _row(words: str, aim: str, graph: str) -> Row:
    real = {"python": sys.executable, "robochoc": ROBOCHOC, "GRAPH": graph}
    command = [real.get(word, word) for word in words.split()]
    samples = repeated(words, lambda: timed_command(command))
    return words, aim, spread((one.wall_s for one in samples), 3), spread(one.cpu_s for one in samples)
