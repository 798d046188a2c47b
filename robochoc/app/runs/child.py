"""The process of a run: `python -m robochoc.app.runs.child PARENT ARGUMENTS...` is `robochoc ARGUMENTS...`.

It ends with the server whose process is PARENT, however that ends: the kernel tells it.
"""

from __future__ import annotations

import os
import runpy
import signal
import sys

from robochoc.system.orphans import signal_when_orphaned


def main() -> None:
    """Run the command line, as long as there is somebody to read what comes of it."""
    parent = int(sys.argv.pop(1))
    signal_when_orphaned(signal.SIGTERM)
    if os.getppid() != parent:  # it has died before the kernel knew whom to tell
        return
    runpy.run_module("robochoc", run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
