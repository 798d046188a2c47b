"""One process of a job: it is started as the first of a group, and ended with all of that group."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import IO

from robochoc.system.stopping import STOP
from robochoc.system.temporary_files import unnamed_file

ROBOCHOC = "robochoc"
MAX_OUT = 64 << 20
"""What a process writes beyond is not read."""
MAX_ERRORS = 8_000
_REAPED_S = 5.0
"""A process that was killed is gone by then, unless the kernel keeps it: then it is left to the kernel."""


@dataclass(frozen=True)
class Command:
    """A process that is to be started.

    Attributes:
        arguments: The arguments of `module`.
        folder: Its current folder. None: this process's.
        module: The module that it runs.
        given: What it reads.
        out: The file that it writes. None: `Finished.out` has what it wrote.
        errors: The file with what it has to say besides. None: none is kept.
        can_be_asked: Whether it is asked to stop by the signal `STOP`, which it is not to die of until it listens.
    """

    arguments: tuple[str, ...]
    folder: Path | None = None
    module: str = ROBOCHOC
    given: bytes = b""
    out: Path | None = None
    errors: Path | None = None
    can_be_asked: bool = False


@dataclass(frozen=True)
class Finished:
    """How a process has ended. `status`: its exit status; negative: the signal that has ended it."""

    status: int
    out: bytes
    errors: str

    @property
    def why(self) -> str:
        """The end of what it has said, or else how it has ended."""
        if self.errors:
            return self.errors
        return f"exit status {self.status}" if self.status >= 0 else signal.Signals(-self.status).name


class GroupProcess:
    """A process, and all that it starts and that stays in its group.

    It must be started by the thread that waits for it: on Linux it is ended with that thread.

    Raises:
        OSError: if it cannot be started.
    """

    def __init__(self, command: Command) -> None:
        self._lock = Lock()
        self._is_over = False
        with ExitStack() as files:
            given = files.enter_context(unnamed_file()) if command.given else None
            if given is not None:
                given.write(command.given)
                given.flush()
                given.seek(0)
            self._out = files.enter_context(command.out.open("w+b") if command.out else unnamed_file())
            self._errors = files.enter_context(command.errors.open("w+b") if command.errors else unnamed_file())
            self._process = _started(command, given, self._out, self._errors)
            self._files = files.pop_all()
        self._reads_out = command.out is None

    @property
    def pid(self) -> int:
        """Its number, which is that of its group."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """Whether it has come to an end. Its number is not given to another one before `finish`."""
        try:
            return os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
        except ChildProcessError:
            return True

    def signal(self, number: int) -> None:
        """Send it a signal."""
        with self._lock, suppress(ProcessLookupError):
            if not self._is_over:
                os.kill(self.pid, number)

    def kill(self) -> None:
        """End it, and whatever is left of its group."""
        with self._lock, suppress(ProcessLookupError, PermissionError):
            if not self._is_over:
                os.killpg(self.pid, signal.SIGKILL)

    def finish(self) -> Finished:
        """End whatever is left, and return how it has ended."""
        self.kill()
        with self._lock:
            self._is_over = True  # from now on the number may be another one's
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_REAPED_S)
        with self._files:
            out = _read(self._out, 0, MAX_OUT) if self._reads_out else b""
            size = os.fstat(self._errors.fileno()).st_size
            errors = _read(self._errors, max(0, size - MAX_ERRORS), MAX_ERRORS).decode(errors="replace").strip()
        status = self._process.returncode
        return Finished(-signal.SIGKILL if status is None else status, out, errors)


def _read(file: IO[bytes], begin: int, most: int) -> bytes:
    file.seek(begin)
    return file.read(most)


def _started(command: Command, given: IO[bytes] | None, out: IO[bytes], errors: IO[bytes]) -> subprocess.Popen[bytes]:
    held = {STOP} if command.can_be_asked else set()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, held)  # it holds it until it knows what it means
    try:
        return subprocess.Popen(  # noqa: S603 - our own module
            [
                *(sys.executable, "-P", "-m", "robochoc.app.jobs.child", str(os.getpid())),
                *(command.module, *command.arguments),
            ],
            cwd=command.folder,
            stdin=subprocess.DEVNULL if given is None else given,
            stdout=out,
            stderr=errors,
            process_group=0,
        )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
