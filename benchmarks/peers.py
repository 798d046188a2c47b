"""Part `peers`: another library on 3-colouring problems like that of part `whole`, where it is installed.

raven-csp (MIT) is the one that PyPI still has in working order:

    python3 -m venv peer && peer/bin/pip install raven-csp sympy
    ROBOCHOC_BENCH_RAVEN=$PWD/peer/bin/python python benchmarks/run.py peers
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from colouring import AGENTS, EDGES, colouring, edges
from measure import ROBOCHOC, Sample, say, spread, timed_command
from report import Row, Section

from robochoc.formats import write_team

PYTHON_OF_RAVEN = "ROBOCHOC_BENCH_RAVEN"
ONCE = str(Path(__file__).with_name("raven_once.py"))
RAVENS = (("abt", "sim"), ("abt", "mp"), ("afc", "sim"))
RUNTIMES = ("simulator", "processes")
SEEDS = range(5)
LIMIT_S = 8


def measured() -> Section:
    """Both libraries, one after the other; a clear line where the peer is missing."""
    rows: list[Row] = [("library", "protocol", "runtime", "solved", "messages", "wall s", "CPU s")]
    python = os.environ.get(PYTHON_OF_RAVEN)
    if python:
        rows += [_ravens(python, protocol, runtime) for protocol, runtime in RAVENS]
    else:
        rows.append(("raven-csp", "-", f"skipped: {PYTHON_OF_RAVEN} names no Python", "-", "-", "-", "-"))
    with tempfile.TemporaryDirectory() as scratch:
        for seed in SEEDS:
            write_team(colouring(seed), _folder(scratch, seed))
        rows += [_ours(scratch, runtime) for runtime in RUNTIMES]
    notes = (
        f"{len(SEEDS)} random 3-colouring problems, seeds {SEEDS[0]}..{SEEDS[-1]}, {AGENTS} agents, {EDGES} edges, "
        f"each solved once, from fork to exit; a run of over {LIMIT_S} s is cut off. Messages are of runs that were "
        f"solved. raven-csp 0.1.0 runs in a Python of its own, which the environment variable {PYTHON_OF_RAVEN} names. "
        "pyDCOP 0.1.1, the version on PyPI, does not run on Python 3.11 (it imports collections.Iterable and "
        "pulp.solvers; with these repaired it gave no answer), so it stays as quoted above, and so does FRODO. "
        "Median (min..max)."
    )
    return Section("peers", "A peer on the same problems", notes, (rows,))


def _folder(scratch: str, seed: int) -> Path:
    return Path(scratch) / f"colouring-{seed}"


def _ravens(python: str, protocol: str, runtime: str) -> Row:
    samples = _each(
        f"raven-csp, {protocol}, {runtime}",
        lambda seed: [python, ONCE, protocol, runtime, json.dumps(edges(seed))],
    )
    messages = [answer["messages"] for answer in _answers(samples) if answer["solved"]]
    return _row(("raven-csp", protocol, runtime), messages, samples)


def _ours(scratch: str, runtime: str) -> Row:
    samples = _each(
        f"robochoc, abt, {runtime}",
        lambda seed: [ROBOCHOC, "solve", str(_folder(scratch, seed)), "--json", "--runtime", runtime],
    )
    messages = [answer["metrics"]["messages"] for answer in _answers(samples) if answer["verdict"] == "solution"]
    return _row(("robochoc", "abt", runtime), messages, samples)


def _each(what: str, command: Callable[[int], list[str]]) -> list[Sample]:
    """One sample a seed."""
    say(what)
    return [timed_command(command(seed), limit_s=LIMIT_S) for seed in SEEDS]


def _answers(samples: Sequence[Sample]) -> list[dict[str, Any]]:
    return [sample.answer for sample in samples if sample.output is not None]


def _row(who: tuple[str, str, str], messages: list[int], samples: Sequence[Sample]) -> Row:
    return (
        *who,
        f"{len(messages)} of {len(samples)}",
        spread(messages, 0) if messages else "-",
        spread(sample.wall_s for sample in samples),
        spread(sample.cpu_s for sample in samples),
    )
