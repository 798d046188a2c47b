"""A search can be asked to stop with the best that it has so far, as if its time was over: by the signal `STOP`.

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
    """Whether somebody has asked this process."""

    made = False


@contextmanager
def stop_heard() -> Iterator[None]:
    """Handle the signal `STOP` inside the context; only possible in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        try:
            yield
        finally:
            _Request.made = False
        return

    def hear(*_: object) -> None:
        _Request.made = True

    before = signal.signal(STOP, hear)
    mask = signal.pthread_sigmask(signal.SIG_UNBLOCK, {STOP})  # the parent may have blocked it
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(STOP, before)
        _Request.made = False


def request_stop() -> None:
    """Ask for it, as the signal does. It holds until `stop_heard` is left."""
    _Request.made = True


def stop_requested() -> bool:
    """Return whether somebody has asked for it."""
    return _Request.made
