"""A run's process, from its start to its end, in a thread that watches it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from robochoc.app.runs.live import LiveReader
from robochoc.app.runs.options import JOURNAL, RESULT
from robochoc.app.runs.prepared import Prepared
from robochoc.app.runs.run import ERRORS, Run, State
from robochoc.formats import InvalidInputError
from robochoc.modelling.places import ModelError
from robochoc.run.options import Options, Withdrawal
from robochoc.run.recording import objective_to_record
from robochoc.system.stopping import STOP

LOOK_S = 0.2
"""The journal is read so often."""
PATIENCE_S = 4.0
"""A run that was asked to stop tells its best so far in this time; then it is told to end, then it is ended."""
_LIMIT = 3
"""The exit status when a limit was reached."""
_MAX_ERRORS = 8_000


class Watched:
    """Starts the process of a run, and watches it. `prepare` writes the files of the run's team."""

    def __init__(self, run: Run, prepare: Callable[[Run], Prepared]) -> None:
        self._run, self._prepare = run, prepare
        self._process: subprocess.Popen[bytes] | None = None
        self._stop_at: float | None = None
        self._said: set[int] = set()
        self._thread: threading.Thread | None = None

    @property
    def pid(self) -> int | None:
        """The process, the first of its group, while there is one."""
        return self._process.pid if self._process and self._process.returncode is None else None

    def start(self, ended: Callable[[Watched], None]) -> None:
        """Begin, in a thread; `ended` is called by it in the end."""

        def work() -> None:
            try:
                self._work()
            finally:
                ended(self)

        self._thread = threading.Thread(target=work, name=f"run {self._run.id}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ask for the best so far; be less patient after a while."""
        if self._stop_at is None:
            self._stop_at = time.monotonic()

    def kill(self) -> None:
        """Have it end now."""
        self._stop_at = time.monotonic() - 2 * PATIENCE_S

    def join(self) -> None:
        """Wait until it has ended."""
        if self._thread:
            self._thread.join(3 * PATIENCE_S)

    def _work(self) -> None:
        run = self._run
        try:
            ready = self._prepare(run)
            withdraw = Withdrawal.MINIMUM if run.record.options.withdraw else None
            objective = objective_to_record(ready.team, Options(withdraw=withdraw))
            run.record.labels = ready.labels
            reader = LiveReader(run.folder / JOURNAL, run.live, ready.label, objective() if objective else None)
        except (ModelError, InvalidInputError, OSError, ValueError, TypeError, KeyError) as mistake:
            self._over(State.FAILED, str(mistake))
            return
        if self._stop_at is not None:
            self._over(State.STOPPED)
            return
        try:
            with _files(run.folder) as (out, errors):
                self._process = _started(run, out, errors)
                self._watch(self._process, reader)
        except OSError as error:
            self._over(State.FAILED, f"{error.strerror}: {error.filename}" if error.filename else str(error))

    def _watch(self, process: subprocess.Popen[bytes], reader: LiveReader) -> None:
        try:
            while process.poll() is None:
                reader.advance()
                self._run.read_result()  # a scene is still to be written then
                self._run.tell()
                self._be_heard(process)
                with suppress(subprocess.TimeoutExpired):
                    process.wait(LOOK_S)
            while reader.advance():
                pass
        finally:
            reader.close()
            _end_group(process)
        self._note(process.returncode)

    def _note(self, status: int) -> None:
        """Note how the process has ended."""
        run = self._run
        run.read_result()
        if self._stop_at is not None and (run.result is None or run.result.verdict == "unknown"):
            self._over(State.STOPPED)
        elif run.result is not None:  # though its scene, say, may not have been written
            self._over(State.ENDED, "" if status in {0, _LIMIT} else self._why(status))
        else:
            self._over(State.FAILED, self._why(status))

    def _why(self, status: int) -> str:
        with suppress(OSError):
            said = (self._run.folder / ERRORS).read_bytes()[-_MAX_ERRORS:].decode(errors="replace").strip()
            if said:
                return said
        return f"exit status {status}" if status >= 0 else signal.Signals(-status).name

    def _over(self, state: State, message: str = "") -> None:
        self._run.become(state, message)
        self._run.tell()

    def _be_heard(self, process: subprocess.Popen[bytes]) -> None:
        """Say what is to be said to a process that has to stop, each once."""
        if self._stop_at is None:
            return
        waited = time.monotonic() - self._stop_at
        if waited >= 2 * PATIENCE_S:
            _end_group(process)
        elif waited >= PATIENCE_S:
            self._say(process, signal.SIGTERM)
        else:
            self._say(process, STOP)

    def _say(self, process: subprocess.Popen[bytes], signum: int) -> None:
        if signum not in self._said:
            self._said.add(signum)
            process.send_signal(signum)


@contextmanager
def _files(folder: Path) -> Iterator[tuple[int, int]]:
    with (folder / RESULT).open("wb") as out, (folder / ERRORS).open("wb") as errors:
        yield out.fileno(), errors.fileno()


def _started(run: Run, out: int, errors: int) -> subprocess.Popen[bytes]:
    """Return the run's process: the first of a group, that ends with this one."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {STOP})  # it holds it until it knows what it means
    try:
        return subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-P", "-m", "robochoc.app.runs.child", str(os.getpid()), *run.record.arguments],
            cwd=run.folder,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=errors,
            process_group=0,
        )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_group(process: subprocess.Popen[bytes]) -> None:
    """End whatever is left of the process and those that it has started."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
