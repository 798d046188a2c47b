"""The operating system's status of a process: its state, whether it computes, and how it ended."""

from __future__ import annotations

import re
import signal
import time
from enum import Enum, auto

from robochoc.communication.processes.forked_process import ChildProcess
from robochoc.communication.resources import read_text

_EXIT_CODE_S, _DYING_S = 1.0, 60.0
_EXIT_CODE_POLL_S = 0.001
_PENDING_SIGNALS = re.compile(r"^SigPnd:\s*([0-9a-f]+)$", re.MULTILINE)
_STOPPED = re.compile(r"^State:\s*T\b", re.MULTILINE)
"""Stopped by a signal; a debugger's `t` is another state."""
_SIGKILL_BIT = 1 << (signal.SIGKILL - 1)


class ProcessStatus(Enum):
    """The state of a process."""

    RUNNING = auto()
    STOPPED = auto()
    DYING = auto()


def process_status(pid: int | None) -> ProcessStatus:
    """Return the state of a process (Linux; elsewhere it is always running).

    A process is dying when SIGKILL is pending, or when it has no memory any more. One with a high `nice` value ends
    late on a busy machine: up to seconds after it was killed.
    """
    status = read_text(f"/proc/{pid}/status")
    if not status:
        return ProcessStatus.RUNNING
    pending = _PENDING_SIGNALS.search(status)
    if "VmSize:" not in status or (pending is not None and bool(int(pending[1], 16) & _SIGKILL_BIT)):
        return ProcessStatus.DYING
    return ProcessStatus.STOPPED if _STOPPED.search(status) else ProcessStatus.RUNNING


def is_computing(pid: int | None) -> bool:
    """Return whether a process uses the processor, or waits for its turn, or for the disk (Linux)."""
    fields = read_text(f"/proc/{pid}/stat").rpartition(")")[2].split()
    return fields[:1] in (["R"], ["D"])


def describe_end(process: ChildProcess) -> str:
    """Return in words how `process` ended. Its sentinel is ready; the exit code follows a moment later.

    Where all cores are busy, that moment can be seconds for a process with a high `nice` value.
    """
    began = time.monotonic()
    # Not `join`, whose time limit ends with the sentinel: a process can close all its files and live on.
    while (code := process.exitcode) is None:
        dying = process_status(process.pid) is ProcessStatus.DYING
        if time.monotonic() - began > (_DYING_S if dying else _EXIT_CODE_S):
            return "its process cannot be reached any more"
        time.sleep(_EXIT_CODE_POLL_S)
    if code < 0:
        return f"its process was killed by {_signal_name(-code)}"
    return f"its process ended with status {code}"


def _signal_name(number: int) -> str:
    """Return the name of a signal, such as SIGKILL. Those in the real-time range have none."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
