"""Signals while processes start: Ctrl-C reaches the whole process group, and only the parent answers it."""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # the C part of `signal`, unknown to typeshed
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_STOPPING = {signal.SIGINT, signal.SIGTERM}
_holding: set[int] = set()
"""The threads in which signals are delayed."""


@contextmanager
def signals_held() -> Iterator[None]:
    """Delay Ctrl-C, SIGTERM and time limits (`system/time_limit.py`) in the block: unfinished work would be lost.

    A process that is started meanwhile holds them as well, until it calls `leave_ctrl_c_to_the_parent`: they would
    break off the start of Python with an error of its own.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    thread = threading.get_ident()
    is_outermost = thread not in _holding
    try:
        # Within, because it may block them and still raise what a signal just before has to say.
        signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
        _holding.add(thread)
        yield
    finally:
        if is_outermost:
            _holding.discard(thread)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def are_held(thread: int) -> bool:
    """Return whether signals are delayed in a thread."""
    return thread in _holding


def leave_ctrl_c_to_the_parent() -> None:
    """In a child process: ignore Ctrl-C, end on SIGTERM, and hold neither of them any longer.

    By the functions beneath `signal`, which looks up an enumeration's member for each number that comes or goes: 1,000
    robots would have 0.2 MB each to themselves for that.
    """
    _signal.signal(_signal.SIGINT, _signal.SIG_IGN)
    _signal.signal(_signal.SIGTERM, _signal.SIG_DFL)
    _signal.pthread_sigmask(_signal.SIG_UNBLOCK, (_signal.SIGINT, _signal.SIGTERM))
