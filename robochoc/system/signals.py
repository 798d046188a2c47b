"""Signals of processes: delayed while processes start, handled by the parent, sent when the parent has died.

Ctrl-C reaches the whole process group, and only the parent handles it.
"""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # the C part of `signal`, unknown to typeshed
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from robochoc.system.posix import IS_POSIX

_STOPPING = {signal.SIGINT, signal.SIGTERM}
_PR_SET_PDEATHSIG = 1
_delayed_threads: set[int] = set()
"""The threads in which signals are delayed."""


@contextmanager
def signals_delayed() -> Iterator[None]:
    """Delay Ctrl-C, SIGTERM and time limits (`system/time_limit.py`) inside the block, which must not be interrupted.

    A process started in the block inherits the delay until it calls `leave_ctrl_c_to_the_parent`, because a signal
    would interrupt the start of Python with an unrelated error. Windows cannot delay signals.
    """
    if not IS_POSIX:
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    thread = threading.get_ident()
    is_outermost = thread not in _delayed_threads
    try:
        # This is inside `try` because it may block the signals and still raise the exception of an earlier signal.
        signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
        _delayed_threads.add(thread)
        yield
    finally:
        if is_outermost:
            _delayed_threads.discard(thread)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def are_delayed(thread: int) -> bool:
    """Return whether signals are delayed in a thread."""
    return thread in _delayed_threads


def leave_ctrl_c_to_the_parent() -> None:
    """In a child process: ignore Ctrl-C, end on SIGTERM, and end the delay of both signals.

    It uses the C functions in `_signal`. The functions in `signal` look up an enumeration member for each number, which
    costs each of 1,000 robots 0.2 MB of unshared memory.
    """
    _signal.signal(_signal.SIGINT, _signal.SIG_IGN)
    _signal.signal(_signal.SIGTERM, _signal.SIG_DFL)
    if IS_POSIX:
        _signal.pthread_sigmask(_signal.SIG_UNBLOCK, (_signal.SIGINT, _signal.SIGTERM))


def signal_when_orphaned(signum: signal.Signals) -> None:
    """Let the kernel send `signum` to this process when its parent dies (Linux; no effect elsewhere).

    SIGCONT is harmless, and continues a stopped process (SIGSTOP), which can then notice the end of its parent.
    Strictly, the kernel watches the thread of the parent that started this process.
    """
    import ctypes  # noqa: PLC0415 - start-up: only child processes need it

    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signum)
