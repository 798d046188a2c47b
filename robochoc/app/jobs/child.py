"""The process of a job: `python -m robochoc.app.jobs.child PARENT MODULE ...` is `python -m MODULE ...`.

It ends with the server whose process is PARENT, however that ends: the kernel tells it.
"""

from __future__ import annotations

import os
import runpy
import signal
import sys

from robochoc.system.orphans import signal_when_orphaned


def main() -> None:
    """Run the module, as long as there is somebody to read what comes of it."""
    parent, module = int(sys.argv.pop(1)), sys.argv.pop(1)
    signal_when_orphaned(signal.SIGTERM)
    if os.getppid() != parent:  # it has died before the kernel knew whom to tell
        return
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
