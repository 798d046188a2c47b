"""`robochoc`: where the program begins, and how signals end it.

Ctrl-C and SIGTERM end it as exceptions do, so that every `finally` has its say: exit status 130 or 143, no process
left, no file half written. Handlers are set before anything else is imported.
"""

from __future__ import annotations

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
_RETRY_S = 0.01
_STOPPING = (signal.SIGINT, signal.SIGTERM)


def main() -> NoReturn:
    """Run the command line, and leave with its exit status."""
    _open_standard_streams()
    ending = TerminationSignals()
    try:
        ending.listen()
        from robochoc.system.streams import prepare_standard_streams

        prepare_standard_streams()
        from robochoc.cli.group import run

        status = run()
        ending.ignore()
    except KeyboardInterrupt:
        sys.stderr.write("robochoc: interrupted\n")
        status = 128 + signal.SIGINT
    sys.exit(status)


def _open_standard_streams() -> None:
    """Let streams that the caller has closed go nowhere: no pipe of ours must take their place."""
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(descriptor, "w" if descriptor else "r"))


class TerminationSignals:
    """The handler of SIGINT and SIGTERM: the first signal raises `KeyboardInterrupt` or `Terminated`.

    It does not raise during an import, as many modules print or swallow exceptions while they load.
    """

    def __init__(self) -> None:
        self._signum = 0
        self._since: float | None = None

    def listen(self) -> None:
        """Install the handlers. Signals that the caller makes the program ignore (`nohup`, `&`) stay ignored."""
        signal.signal(signal.SIGALRM, self._again)
        sys.unraisablehook = self._swallowed
        for signum in _STOPPING:
            if signal.getsignal(signum) is not signal.SIG_IGN:
                signal.signal(signum, self._hear)

    def ignore(self) -> None:
        """Ignore further signals: the work is done."""
        signal.setitimer(signal.ITIMER_REAL, 0)
        for signum in (*_STOPPING, signal.SIGALRM):
            signal.signal(signum, signal.SIG_IGN)

    def _hear(self, signum: int, frame: FrameType | None) -> None:
        if self._since is not None:
            if time.monotonic() - self._since > PATIENCE_S:
                signal.signal(signum, signal.SIG_DFL)
                signal.raise_signal(signum)
            return
        self._signum = signum
        if _importing(frame):
            signal.setitimer(signal.ITIMER_REAL, _RETRY_S)
            return
        self._since = time.monotonic()
        if signum == signal.SIGINT:
            raise KeyboardInterrupt
        raise Terminated(128 + signum)

    def _again(self, _signum: int, frame: FrameType | None) -> None:
        self._hear(self._signum, frame)

    def _swallowed(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Raise again, soon, what Python has dropped because it was raised within a finaliser or a callback."""
        if self._since is not None and isinstance(unraisable.exc_value, KeyboardInterrupt | SystemExit):
            self._since = None
            signal.setitimer(signal.ITIMER_REAL, _RETRY_S)
        else:
            sys.__unraisablehook__(unraisable)


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
