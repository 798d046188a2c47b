"""How a figure is taken: in a process of its own, several times, and kept with its spread."""

from __future__ import annotations

import json
import multiprocessing
import os
import resource
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

RUNS = 5
"""How often everything is measured that has a spread."""
ROOT = Path(__file__).resolve().parents[1]
ROBOCHOC = str(Path(sys.executable).with_name("robochoc"))


class Sample(NamedTuple):
    """One run of one process: seconds from fork to exit, CPU seconds of it and all below it, and what it printed.

    `output` is None when the run was cut off by a time limit.
    """

    wall_s: float
    cpu_s: float
    output: str | None = ""

    @property
    def answer(self) -> Any:  # noqa: ANN401 - JSON is anything
        """The output, read as JSON; None when there is none."""
        return None if self.output is None else json.loads(self.output)


class FailedError(Exception):
    """What was to be measured did not do its work."""


def say(what: str) -> None:
    """Tell on stderr what is being measured."""
    print(f"  {what} ...", file=sys.stderr, flush=True)


def spread(values: Iterable[float], digits: int = 2) -> str:
    """The median, and the smallest and largest value: `0.34 (0.31..0.40)`; one value alone if all are equal."""
    values = list(values)
    median, low, high = statistics.median(values), min(values), max(values)
    if low == high:
        return f"{median:,.{digits}f}"
    return f"{median:,.{digits}f} ({low:,.{digits}f}..{high:,.{digits}f})"


def timed_command(command: Sequence[str], *, expected: Sequence[int] = (0,), limit_s: float | None = None) -> Sample:
    """Run `command` in the checkout's root, and kill it with all that it started once `limit_s` is over.

    Raises `FailedError` when it ends with a status that is not `expected`.
    """
    before, began = _children_cpu_s(), time.perf_counter()
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            output, errors = process.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            return Sample(time.perf_counter() - began, _children_cpu_s() - before, None)
        except BaseException:
            os.killpg(process.pid, signal.SIGTERM)
            raise
    wall_s = time.perf_counter() - began
    if process.returncode not in expected:
        raise FailedError(f"{' '.join(command)} ended with status {process.returncode}: {errors.strip()[-500:]}")
    return Sample(wall_s, _children_cpu_s() - before, output)


def timed_call(act: Callable[[], None]) -> Sample:
    """Run `act` in a forked process. Raises `FailedError` when it does not end well."""
    before, began = _children_cpu_s(), time.perf_counter()
    process = multiprocessing.get_context("fork").Process(target=act)
    process.start()
    process.join()
    wall_s = time.perf_counter() - began
    if process.exitcode:
        raise FailedError(f"a measured process ended with status {process.exitcode}")
    return Sample(wall_s, _children_cpu_s() - before)


def repeated(what: str, take: Callable[[], Sample], runs: int = RUNS) -> list[Sample]:
    """`runs` samples, after one word about it."""
    say(what)
    return [take() for _ in range(runs)]


def _children_cpu_s() -> float:
    """CPU seconds, user and system, of all processes below this one that have ended and been waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
