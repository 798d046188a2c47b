"""The process of a job: `python -m robochoc.app.jobs.child PARENT MODULE ...` runs `python -m MODULE ...`.

The kernel ends the process by a signal when the server process PARENT ends.
"""

from __future__ import annotations

import os
import runpy
import signal
import sys

from robochoc.system.signals import signal_when_orphaned


def main() -> None:
    """Run the module, unless the parent process has already ended."""
    parent, module = int(sys.argv.pop(1)), sys.argv.pop(1)
    signal_when_orphaned(signal.SIGTERM)
    if os.getppid() != parent:  # the parent ended before the signal was requested
        return
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
