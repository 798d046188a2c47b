"""Requests to stop a search with its best result so far, as at its time limit: by the signal `STOP`.

    kill -USR1 PID

Ctrl-C and SIGTERM end the program without an answer.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

STOP = signal.SIGUSR1


class _Request:
    """The state of the request in this process."""

    is_made = False


@contextmanager
def stop_handled() -> Iterator[None]:
    """Handle the signal `STOP` inside the context; only possible in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        try:
            yield
        finally:
            _Request.is_made = False
        return

    def handle(*_: object) -> None:
        _Request.is_made = True

    before = signal.signal(STOP, handle)
    mask = signal.pthread_sigmask(signal.SIG_UNBLOCK, {STOP})  # the parent may have blocked it
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(STOP, before)
        _Request.is_made = False


def request_stop() -> None:
    """Request a stop like the signal. The request ends with the `stop_handled` block."""
    _Request.is_made = True


def stop_requested() -> bool:
    """Return whether a stop was requested."""
    return _Request.is_made
