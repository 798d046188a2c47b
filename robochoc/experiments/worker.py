"""A worker on this machine: reads tasks from a socket, and writes their rows to it, until the socket is closed.

The worker is a separate program, `python -m robochoc.experiments.worker DESCRIPTOR PARENT MEMORY_MB`, so that a task
that crashes ends only this process.
"""

from __future__ import annotations

import os
import resource
import signal
import socket
import sys

import msgspec

from robochoc.experiments.execute import TaskRunner
from robochoc.experiments.frames import read_frame, write_frame
from robochoc.experiments.task import Status, Task
from robochoc.system.signals import leave_ctrl_c_to_the_parent, signal_when_orphaned

_MB = 2**20


def main(descriptor: int, parent: int, memory_mb: int) -> None:
    """Run tasks until there are no more.

    Args:
        descriptor: The descriptor of the socket.
        parent: The id of the parent process.
        memory_mb: The limit on memory in megabytes. 0: no limit.
    """
    leave_ctrl_c_to_the_parent()
    signal_when_orphaned(signal.SIGKILL)
    if os.getppid() != parent:
        return
    if memory_mb:
        resource.setrlimit(resource.RLIMIT_DATA, (memory_mb * _MB, resource.RLIM_INFINITY))
    with socket.socket(fileno=descriptor) as connection, TaskRunner() as bench:
        while (content := read_frame(connection)) is not None:
            row = bench.run(msgspec.json.decode(content, type=Task))
            write_frame(connection, msgspec.json.encode(row))
            if row.status == Status.MEMORY:
                return  # the process is damaged; another worker replaces it


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
