"""The operating system's status of a process: running, stopped or dying, whether it computes, and why it ended."""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Iterable, Mapping
from enum import Enum, auto

from robochoc.communication.processes.forked_process import ChildProcess
from robochoc.communication.resources import read_text

REPORT_AFTER_S = 5.0
"""The time after which a stopped robot is reported, in seconds."""
LONGEST_STEP_S = 1.0
"""The longest time counted between two updates: the same Ctrl-Z may have stopped this process too."""
_EXIT_CODE_S, _DYING_S = 1.0, 60.0
_EXIT_CODE_POLL_S = 0.001
_PENDING_SIGNALS = re.compile(r"^SigPnd:\s*([0-9a-f]+)$", re.MULTILINE)
_STOPPED = re.compile(r"^State:\s*T\b", re.MULTILINE)
"""Stopped by a signal. The state `t` (stopped by a debugger) is different."""
_SIGKILL_BIT = 1 << (signal.SIGKILL - 1)


class ProcessStatus(Enum):
    """The state of a process."""

    RUNNING = auto()
    STOPPED = auto()
    DYING = auto()


def process_status(pid: int | None) -> ProcessStatus:
    """Return the state of a process (on Linux; on other systems it is always running).

    A process is dying if SIGKILL is pending, or if it no longer has memory. A process with a high `nice` value ends
    late on a busy machine, up to seconds after it was killed.
    """
    status = read_text(f"/proc/{pid}/status")
    if not status:
        return ProcessStatus.RUNNING
    pending = _PENDING_SIGNALS.search(status)
    if "VmSize:" not in status or (pending is not None and bool(int(pending[1], 16) & _SIGKILL_BIT)):
        return ProcessStatus.DYING
    return ProcessStatus.STOPPED if _STOPPED.search(status) else ProcessStatus.RUNNING


def is_computing(pid: int | None) -> bool:
    """Return whether a process uses the processor, or waits for the processor or the disk (Linux)."""
    fields = read_text(f"/proc/{pid}/stat").rpartition(")")[2].split()
    return fields[:1] in (["R"], ["D"])


def describe_end(process: ChildProcess) -> str:
    """Describe the end of `process`. Its sentinel is ready; the exit code follows a moment later.

    If all cores are busy, a process with a high `nice` value may need seconds for this.
    """
    began = time.monotonic()
    # Not `join`, whose time limit ends when the sentinel closes: a process can close all its files and continue to run.
    while (code := process.exitcode) is None:
        dying = process_status(process.pid) is ProcessStatus.DYING
        if time.monotonic() - began > (_DYING_S if dying else _EXIT_CODE_S):
            return "its process cannot be reached any more"
        time.sleep(_EXIT_CODE_POLL_S)
    if code < 0:
        return f"its process was killed by {_signal_name(-code)}"
    return f"its process ended with status {code}"


def _signal_name(number: int) -> str:
    """Return the name of a signal, such as SIGKILL. Real-time signals have only a number."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


class StoppedRobots:
    """Measures how long robots have been stopped (SIGSTOP). After `patience_s` seconds (None: never) they are lost.

    Without this class, the team would wait in silence. A robot in a long computation is not stopped: the kernel
    distinguishes the two states.
    """

    def __init__(self, patience_s: float | None = None) -> None:
        self._patience_s = patience_s
        self._updated: float | None = None
        self._stopped_s: dict[str, float] = {}
        self._reported: set[str] = set()

    def update(self, stopped: Iterable[str], now: float) -> Mapping[str, str]:
        """Record the robots that are `stopped` at the time `now` (seconds). Return the lost robots with the reasons.

        Logs a warning about a robot that has been stopped for a long time, and a message when it continues.
        """
        passed = 0.0 if self._updated is None else min(now - self._updated, LONGEST_STEP_S)
        self._updated = now
        before = self._stopped_s
        self._stopped_s = {name: before[name] + passed if name in before else 0.0 for name in stopped}
        for name in self._reported - self._stopped_s.keys():
            self._reported.discard(name)
            _warn(f"{name} continues")
        lost = {} if self._patience_s is None else {n: s for n, s in self._stopped_s.items() if s >= self._patience_s}
        for name, seconds in self._stopped_s.items():
            if seconds >= REPORT_AFTER_S and name not in self._reported and name not in lost:
                self._reported.add(name)
                _warn(f"{name} has been stopped (SIGSTOP) for {seconds:.0f} s; the others wait for it{self._hint}")
        for name in lost:
            del self._stopped_s[name]
            self._reported.discard(name)
        return {name: f"its process had been stopped (SIGSTOP) for {seconds:.0f} s" for name, seconds in lost.items()}

    @property
    def _hint(self) -> str:
        if self._patience_s is None:
            return " (kill -CONT continues it; --patience SECONDS limits the wait)"
        return f" (kill -CONT continues it; after {self._patience_s:g} s it is lost)"


def _warn(text: str) -> None:
    import logging  # noqa: PLC0415 - nearly no run has anything to report

    logging.getLogger("robochoc").warning("%s", text)
