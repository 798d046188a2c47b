"""The router's process: `python -m robochoc.communication.network.router_process`, started by `router.py`.

The process reads its configuration from standard input, reports when it listens, answers each further line, and ends
when standard input ends, at the latest when the master ends. It then removes the master's scratch folder. It imports
very little, because opening the router includes waiting for this process.
"""

from __future__ import annotations

import json
import os
import signal
import sys

import zenoh

from robochoc.communication.network.zenoh_config import config
from robochoc.system.signals import leave_ctrl_c_to_the_parent, signal_when_orphaned

READY = "listening"
RESPONDING = "responding"


def main() -> None:
    """Run the router until standard input ends."""
    signal_when_orphaned(signal.SIGCONT)  # a stopped process does not see the end of standard input
    leave_ctrl_c_to_the_parent()
    zenoh.init_log_from_env_or("error")
    scratch, settings = json.loads(sys.stdin.readline()), json.loads(sys.stdin.readline())
    with zenoh.open(config(settings)):
        sys.stdout.write(f"{READY}\n")
        sys.stdout.flush()
        while sys.stdin.readline():
            sys.stdout.write(f"{RESPONDING}\n")
            sys.stdout.flush()
        if scratch:  # the master was killed, and could not remove the folder
            import shutil  # noqa: PLC0415 - seldom needed

            shutil.rmtree(scratch, ignore_errors=True)
        os._exit(0)  # closing links to clients that are gone would take seconds


if __name__ == "__main__":
    main()
