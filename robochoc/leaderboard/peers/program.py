"""Runs a program of another tool in a process group of its own, with limits of time and output."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from robochoc.system.signals import signal_when_orphaned, signals_delayed

LARGEST_FILE = 64 * 2**20
"""The maximum size of a file that a program writes, its output included, in bytes."""


class EndedProgram(NamedTuple):
    """A program that has ended.

    Attributes:
        status: The exit status. None: it was killed at the time limit.
        output: Its standard output.
        errors: Its standard error.
        cpu_s: The seconds of processor time.
    """

    status: int | None
    output: str
    errors: str
    cpu_s: float


def run_program(command: Sequence[str], folder: Path, limit_s: float) -> EndedProgram:
    """Run a command in `folder`, and kill its process group at its end, or after `limit_s` seconds.

    Raises:
        OSError: if it cannot be started.
    """
    before = _cpu_s()
    output, errors = folder / "standard-output", folder / "standard-error"
    with output.open("wb") as out, errors.open("wb") as err:
        with signals_delayed():
            process = subprocess.Popen(  # noqa: S603 - the user's command
                [*command],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                start_new_session=True,  # so that all its processes can be ended
                preexec_fn=_limit,  # noqa: PLW1509 - it only calls the kernel
            )
        try:
            status: int | None = process.wait(limit_s)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    written, reported = (path.read_text(encoding="utf-8", errors="replace") for path in (output, errors))
    return EndedProgram(status, written, reported, _cpu_s() - before)


def _limit() -> None:
    """Limit the files of the new process, and let the kernel end it when robochoc is killed (Linux)."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    signal_when_orphaned(signal.SIGKILL)


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
