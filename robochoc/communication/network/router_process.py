"""The router's process: `python -m robochoc.communication.network.router_process`, started by `router.py`.

It takes its configuration from standard input, says when it listens, and ends when standard input does, so never later
than the master. Next to nothing is imported: whoever opens the router anew waits for it.
"""

from __future__ import annotations

import json
import os
import signal
import sys

import zenoh

from robochoc.communication.network.zenoh_config import config

READY = "listening"


def main() -> None:
    """Be the router until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    zenoh.init_log_from_env_or("error")
    settings = json.loads(sys.stdin.readline())
    with zenoh.open(config(settings)):
        sys.stdout.write(f"{READY}\n")
        sys.stdout.flush()
        while sys.stdin.read(1):
            pass
        os._exit(0)  # to take leave of clients that are gone as well would take seconds


if __name__ == "__main__":
    main()
