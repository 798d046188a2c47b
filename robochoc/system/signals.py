"""Signals while processes start: Ctrl-C reaches the whole process group, and only the parent answers it."""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # what `signal` is made of: typeshed does not tell of it
import signal
from collections.abc import Iterator
from contextlib import contextmanager

_STOPPING = {signal.SIGINT, signal.SIGTERM}


@contextmanager
def signals_held() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait meanwhile: what is half done would be lost.

    A process that is started meanwhile holds them as well, until it calls `leave_ctrl_c_to_the_parent`: they would
    break off the start of Python with an error of its own.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        # Within, because it may block them and still raise what a signal just before has to say.
        signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def leave_ctrl_c_to_the_parent() -> None:
    """In a child process: ignore Ctrl-C, end on SIGTERM, and hold neither of them any longer.

    By the functions beneath `signal`, which looks up an enumeration's member for each number that comes or goes: 1,000
    robots would have 0.2 MB each to themselves for that.
    """
    _signal.signal(_signal.SIGINT, _signal.SIG_IGN)
    _signal.signal(_signal.SIGTERM, _signal.SIG_DFL)
    _signal.pthread_sigmask(_signal.SIG_UNBLOCK, (_signal.SIGINT, _signal.SIGTERM))
