"""Which rules of a sketch are in each other's way: the search is a process of its own, and ends in time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from enum import StrEnum

import msgspec

from robochoc.app.sketch.sketch import Sketch

PATIENCE_S = 30.0
"""The search is given so long."""
_GRACE_S = 5.0


class Finder(StrEnum):
    """The tool that has found a conflict."""

    CPMPY = "cpmpy"
    OWN = "own"


class Conflict(msgspec.Struct, frozen=True):
    """The result of a search for rules that cannot hold together.

    Attributes:
        rules: The ids of rules that cannot hold together; any proper subset of them can. Empty: the decisions
            themselves have no values. None: all rules can hold together, or nothing was found in time.
        finder: The tool that has found it.
        late: Whether the time was over before.
        why: Why the search has failed; empty if it has not.
    """

    rules: tuple[str, ...] | None
    finder: Finder = Finder.OWN
    late: bool = False
    why: str = ""


class ConflictSearch:
    """A search. `found` waits for it, `stop` ends it from another thread."""

    def __init__(self, sketch: Sketch, seconds: float = PATIENCE_S) -> None:
        self._sketch, self._seconds = sketch, seconds
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = threading.Event()

    def found(self) -> Conflict:
        """Search; return what was found."""
        with self._lock:
            if self._stopped.is_set():
                return Conflict(None, late=True)
            self._process = subprocess.Popen(  # noqa: S603 - our own module
                [sys.executable, "-P", "-m", "robochoc.app.conflicts.process", str(os.getpid()), str(self._seconds)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                process_group=0,
            )
        with self._process as process:
            try:
                said, errors = process.communicate(msgspec.json.encode(self._sketch), self._seconds + _GRACE_S)
            except subprocess.TimeoutExpired:
                self._kill()
                return Conflict(None, late=True)
            finally:
                self._kill()
        if self._stopped.is_set():
            return Conflict(None, late=True)
        if process.returncode or not said:
            lines = errors.decode(errors="replace").strip().splitlines()
            return Conflict(None, why=lines[-1] if lines else f"exit status {process.returncode}")
        return msgspec.json.decode(said, type=Conflict)

    def stop(self) -> None:
        """End it."""
        with self._lock:
            self._stopped.set()
        self._kill()

    def _kill(self) -> None:
        if self._process is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
