"""Cleans up in the fork server when its parent has ended: removes the parent's temporary folder, and ends silently.

This is a separate module because importing it has these effects, which are wanted only in the fork server. A killed
parent cannot remove the folder. The router removes it too, but not every run has a router. A parent that is killed
during a request leaves an incomplete request, which `multiprocessing` does not expect.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
from types import TracebackType

SCRATCH = "ROBOCHOC_SCRATCH"
"""The environment variable with the path of the folder."""


def _without_a_parent(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Ignore the error caused by an incomplete request, in the fork server and in the process that it has forked.

    Errors in a robot are printed by the robot's process (`Process._bootstrap`), and do not reach this hook.
    """
    truncated = kind.__name__ == "UnpicklingError" and "truncated" in str(error)
    if not (truncated or issubclass(kind, EOFError)):
        sys.__excepthook__(kind, error, trace)


if _scratch := os.environ.pop(SCRATCH, ""):
    atexit.register(shutil.rmtree, _scratch, ignore_errors=True)
    sys.excepthook = _without_a_parent
