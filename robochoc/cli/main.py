"""The entry point of `robochoc`, and its signal handlers.

Ctrl-C and SIGTERM end the program by an exception, so that every `finally` runs: the exit status is 130 or 143, and no
child process or partly written file is left. The handlers are installed before anything else is imported.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import time

from robochoc.system.termination import Terminated

TYPE_CHECKING = False  # see robochoc/__init__.py
if TYPE_CHECKING:
    from types import FrameType
    from typing import NoReturn

PATIENCE_S = 1.0
"""Seconds in which further signals count as the first (two Ctrl-C, `timeout` and a shell). Later ones force an end."""
YOUNG_OBJECTS = 50_000
"""The number of new objects that starts a garbage collection. With Python's 700, imports start 40 that free nothing."""
_RETRY_S = 0.01
_STOPPING = (signal.SIGINT, signal.SIGTERM)
_HAS_TIMER = hasattr(signal, "setitimer")
"""True if a signal can be handled later. If not (on Windows), it raises at once, even during an import."""


def main() -> NoReturn:
    """Run the command line, and exit with its status."""
    gc.set_threshold(YOUNG_OBJECTS)
    _open_standard_streams()
    signals = TerminationSignals()
    try:
        signals.install()
        from robochoc.system.streams import prepare_standard_streams

        prepare_standard_streams()
        from robochoc.cli.group import run

        status = run()
        signals.ignore()
    except KeyboardInterrupt:
        sys.stderr.write("robochoc: interrupted\n")
        status = 128 + signal.SIGINT
    gc.freeze()  # otherwise Python visits all objects before it ends
    sys.exit(status)


def _open_standard_streams() -> None:
    """Redirect closed standard streams to /dev/null, so that none of our pipes is given their descriptors."""
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(descriptor, "w" if descriptor else "r"))


class TerminationSignals:
    """The handler of SIGINT and SIGTERM: the first signal raises `KeyboardInterrupt` or `Terminated`.

    The handler never raises during an import, since many modules print or suppress exceptions while they are loaded, or
    in `__set_name__`.
    """

    def __init__(self) -> None:
        self._signum = 0
        self._since: float | None = None

    def install(self) -> None:
        """Install the handlers. Signals that the caller set to be ignored (`nohup`, `&`) stay ignored."""
        if _HAS_TIMER:
            signal.signal(signal.SIGALRM, self._retry)
        sys.unraisablehook = self._raise_again
        for signum in _STOPPING:
            if signal.getsignal(signum) is not signal.SIG_IGN:
                signal.signal(signum, self._handle)

    def ignore(self) -> None:
        """Ignore further signals, since the work is done."""
        ignored: tuple[signal.Signals, ...] = _STOPPING
        if _HAS_TIMER:
            signal.setitimer(signal.ITIMER_REAL, 0)
            ignored += (signal.SIGALRM,)
        for signum in ignored:
            signal.signal(signum, signal.SIG_IGN)

    def _handle(self, signum: int, frame: FrameType | None) -> None:
        if self._since is not None:
            if time.monotonic() - self._since > PATIENCE_S:
                signal.signal(signum, signal.SIG_DFL)
                signal.raise_signal(signum)
            return
        self._signum = signum
        if _HAS_TIMER and _importing(frame):
            signal.setitimer(signal.ITIMER_REAL, _RETRY_S)
            return
        self._since = time.monotonic()
        if signum == signal.SIGINT:
            raise KeyboardInterrupt
        raise Terminated(128 + signum)

    def _retry(self, _signum: int, frame: FrameType | None) -> None:
        self._handle(self._signum, frame)

    def _raise_again(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Raise the exception again soon if Python dropped it because it was raised in a finaliser or a callback."""
        if _HAS_TIMER and self._since is not None and isinstance(unraisable.exc_value, KeyboardInterrupt | SystemExit):
            self._since = None
            signal.setitimer(signal.ITIMER_REAL, _RETRY_S)
        else:
            sys.__unraisablehook__(unraisable)


def _importing(frame: FrameType | None) -> bool:
    """Return whether a module is imported, or a class asks `__set_name__`, whose exceptions Python 3.11 replaces."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib") or frame.f_code.co_name == "__set_name__":
            return True
        frame = frame.f_back
    return False
