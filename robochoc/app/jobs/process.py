"""One process of a job. It leads a process group, and is ended together with the group."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import ExitStack, suppress
from pathlib import Path
from threading import Lock
from typing import IO

from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.stopping import STOP
from robochoc.system.temporary_files import unnamed_file

ROBOCHOC = "robochoc"
MAX_OUT = 64 << 20
"""The maximum number of bytes read from a process's output."""
MAX_ERRORS = 8_000
_REAPED_S = 5.0
"""The maximum time to wait for the end of a killed process, in seconds."""


@dataclass(frozen=True)
class Command:
    """A process to start.

    Attributes:
        arguments: The arguments for `module`.
        folder: The working directory. None: the working directory of this process.
        module: The module to run.
        given: The standard input.
        out: The file for the standard output. None: the output is returned in `Finished.out`.
        errors: The file for the standard error. None: no file.
        can_be_asked: True if the signal `STOP` asks the process to stop. The signal is blocked until the process
            handles it.
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
    """The result of a process. `status` is the exit status, or minus the number of the signal that ended it."""

    status: int
    out: bytes
    errors: str

    @property
    def why(self) -> str:
        """The end of the standard error, or the exit status if there is none."""
        if self.errors:
            return self.errors
        return f"exit status {self.status}" if self.status >= 0 else signal.Signals(-self.status).name


class GroupProcess:
    """A process that leads a process group.

    The thread that starts the process must wait for it: on Linux, the process ends together with that thread.

    Raises:
        OSError: if the process cannot be started.
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
        """The process id, which is also the id of its group."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """True if the process has ended. Its id is not reused before `finish`."""
        try:
            return os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
        except ChildProcessError:
            return True

    def signal(self, number: int) -> None:
        """Send a signal to the process."""
        with self._lock, suppress(ProcessLookupError):
            if not self._is_over:
                os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill the process group."""
        with self._lock, suppress(ProcessLookupError, PermissionError):
            if not self._is_over:
                os.killpg(self.pid, signal.SIGKILL)

    def finish(self) -> Finished:
        """Kill the process group, and return the result."""
        self.kill()
        with self._lock:
            self._is_over = True  # from now on another process may have the id
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
    before = signal.pthread_sigmask(signal.SIG_BLOCK, held)  # blocked until the process handles the signal
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
