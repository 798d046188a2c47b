"""Clean-up in the fork server when its parent has ended: remove the parent's temporary folder, and end in silence.

Only in the fork server this module does something. A parent that was killed cannot remove the folder. The router
removes it too, but not every run has a router. A parent that was killed in the middle of a request leaves a connection
without what it was to bring, which `multiprocessing` does not expect.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
from types import TracebackType

SCRATCH = "ROBOCHOC_SCRATCH"
"""The environment's variable by which the parent says which folder that is."""


def _without_a_parent(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Say nothing of a request whose rest does not come, in the fork server and in the process that it has forked.

    What goes wrong in a robot is told by the process itself (`Process._bootstrap`), and does not come here.
    """
    truncated = kind.__name__ == "UnpicklingError" and "truncated" in str(error)
    if not (truncated or issubclass(kind, EOFError)):
        sys.__excepthook__(kind, error, trace)


if _scratch := os.environ.pop(SCRATCH, ""):
    atexit.register(shutil.rmtree, _scratch, ignore_errors=True)
    sys.excepthook = _without_a_parent
