"""Processes end when their parent dies, for whatever reason."""

from __future__ import annotations

import ctypes
import signal
import sys

_PR_SET_PDEATHSIG = 1


def signal_when_orphaned(signum: signal.Signals) -> None:
    """Have the kernel send `signum` to this process when its parent dies (Linux; elsewhere nothing happens).

    SIGCONT does no harm, and lets one go on that is stopped (SIGSTOP), so that it sees the end of its parent too.
    Strictly, it is the parent's thread that counts: the one that has started this process.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signum)
