"""One run of any library as a process of its own: time, CPU, memory, and what it printed; cut off at its limits."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from measure import ROOT

NO_LIMIT = resource.RLIM_INFINITY


class Run(NamedTuple):
    """One run, from fork to exit.

    `cpu_s` is that of the process and of all below it that it waited for. `peak_mb` is the largest resident size of
    one process among them. `status` is None when the run was cut off.
    """

    wall_s: float
    cpu_s: float
    peak_mb: float
    status: int | None
    output: str
    errors: str


def watched(command: Sequence[str], limit_s: float, cpu_s: int = NO_LIMIT, folder: Path = ROOT) -> Run:
    """Run `command` in `folder`, and kill it with all that it started once `limit_s` is over.

    It is killed, too, when it has used `cpu_s` seconds of CPU: on a busy machine, the time says little.
    """
    late = threading.Event()

    def stop() -> None:
        late.set()
        os.killpg(process.pid, signal.SIGKILL)

    nothing = subprocess.DEVNULL
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        began = time.perf_counter()
        process = subprocess.Popen(
            command, cwd=folder, stdin=nothing, stdout=output, stderr=errors, text=True, start_new_session=True
        )
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (cpu_s, cpu_s))
        alarm = threading.Timer(limit_s, stop)
        alarm.start()
        try:
            os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        finally:
            alarm.cancel()
        # Its group still has its number: whoever it has left behind would be in the next one's way.
        os.killpg(process.pid, signal.SIGKILL)
        _, status, used = os.wait4(process.pid, 0)
        wall_s = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        errors.seek(0)
        used_s = used.ru_utime + used.ru_stime
        # The kernel's two accounts of CPU differ: some are killed before the second has come to the limit.
        spent = process.returncode == -signal.SIGKILL and 0 < cpu_s <= 2 * used_s
        ended = None if late.is_set() or spent else process.returncode
        return Run(wall_s, used_s, used.ru_maxrss / 1024, ended, output.read(), errors.read())
