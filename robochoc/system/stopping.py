"""Stopping a search early on request. Its answer is then the best known one, as at a time limit.

Another program sends the signal `STOP` (`kill -USR1 PID`); a thread in this program sets an event. Ctrl-C and SIGTERM
end the program without an answer.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

STOP: int = getattr(signal, "SIGUSR1", 0)
"""The signal, or 0 on systems that do not have it."""
_EVENT: ContextVar[threading.Event | None] = ContextVar("stop", default=None)
"""The event that stops the runs in this thread."""


class _Request:
    """The stop request to this process."""

    is_made = False


@contextmanager
def stop_handled() -> Iterator[None]:
    """Handle the signal `STOP` inside the context. This is possible only in the main thread."""
    if not STOP or threading.current_thread() is not threading.main_thread():
        try:
            yield
        finally:
            _Request.is_made = False
        return

    def on_signal(*_: object) -> None:
        _Request.is_made = True

    before = signal.signal(STOP, on_signal)
    mask = signal.pthread_sigmask(signal.SIG_UNBLOCK, {STOP})  # the parent may have blocked the signal
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(STOP, before)
        _Request.is_made = False


@contextmanager
def stopped_by(event: threading.Event | None) -> Iterator[None]:
    """Inside the context, stop the searches in this thread when the event is set."""
    token = _EVENT.set(event)
    try:
        yield
    finally:
        _EVENT.reset(token)


def request_stop() -> None:
    """Request the end of all searches in this process, like the signal, until `stop_handled` is left."""
    _Request.is_made = True


def stop_requested() -> bool:
    """Return whether the search in this thread must stop."""
    event = _EVENT.get()
    return _Request.is_made or (event is not None and event.is_set())
