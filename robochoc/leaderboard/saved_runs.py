"""Saves the finished runs of `leaderboard run` in a file beside its output, so that the same command continues.

The first line describes the command, each other line is a run. The file is deleted when the output is complete.
"""

from __future__ import annotations

import fcntl
import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Self

import msgspec

from robochoc import __version__
from robochoc.experiments.task import Status
from robochoc.formats.diagnostics import invalid_input
from robochoc.leaderboard.instances import SET_VERSION, Instance
from robochoc.leaderboard.results import FORMAT, LARGEST_FILE, Budget, Entrant, RunResult
from robochoc.system.files import errors_naming

FAILED = {Status.LOST, Status.REFUTED, Status.MEMORY, Status.CRASHED, Status.ERROR}
"""The states of runs that failed, which are repeated when a command continues."""


def command_line(
    entrants: Sequence[Entrant], instances: Sequence[Instance], budget: Budget, *, seed: int, times: bool
) -> bytes:
    """Return the first line of the file: all that determines the results. For the arguments see `run_leaderboard`."""
    names = [one.name for one in instances]
    versions = [FORMAT, SET_VERSION, __version__]
    return msgspec.json.encode([*versions, seed, times, budget, list(entrants), names]) + b"\n"


class SavedRuns:
    """The runs of a command by instance and protocol, which a file contains until the command ends.

    Args:
        path: The file. None: runs are kept in memory only.
        command: The first line of the file.

    Raises:
        InvalidInputError: if the file is in use, or has the runs of another command.
        OSError: if the file cannot be read or written.
    """

    def __init__(self, path: Path | None = None, command: bytes = b"") -> None:
        self.found: dict[tuple[str, str], RunResult] = {}
        self._path = path
        self._file = -1
        self._has_runs = False
        if path is None:
            return
        with errors_naming(path):
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
        try:
            self._read(path, command)
        except BaseException:
            os.close(self._file)
            raise

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file, and delete it if it contains no runs."""
        if not self._has_runs:
            self.delete()
        if self._file >= 0:
            os.close(self._file)

    def _read(self, path: Path, command: bytes) -> None:
        if not stat.S_ISREG(os.fstat(self._file).st_mode):
            raise invalid_input(path, "is not a regular file", "delete it, or choose another -o")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            hint = "wait for its end, or choose another -o"
            raise invalid_input(path, "is being written by another 'robochoc leaderboard run'", hint) from None
        with path.open("rb") as file:
            lines = file.read(LARGEST_FILE).splitlines(keepends=True)
        if lines and not command.startswith(lines[0]):
            hint = "repeat that command, choose another -o, or delete this file"
            raise invalid_input(path, "has the runs of another command, which was interrupted", hint)
        size = len(command)
        with suppress(msgspec.MsgspecError, UnicodeDecodeError, RecursionError):  # an incomplete line is the last one
            for line in (line for line in lines[1:] if line.endswith(b"\n")):
                run = msgspec.json.decode(line, type=RunResult)
                self.found[run.instance, run.protocol] = run
                size += len(line)
        self._has_runs = bool(self.found)
        if not self._has_runs:
            os.ftruncate(self._file, 0)
            os.write(self._file, command)
        os.ftruncate(self._file, size)

    def add(self, run: RunResult) -> None:
        """Add a run; one that failed is not written to the file. Raises `OSError`."""
        self.found[run.instance, run.protocol] = run
        if self._path and run.status not in FAILED:
            with errors_naming(self._path):
                os.write(self._file, msgspec.json.encode(run) + b"\n")
            self._has_runs = True

    def delete(self) -> None:
        """Delete the file."""
        if self._path:
            self._path.unlink(missing_ok=True)
