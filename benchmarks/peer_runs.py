"""One run of any library as a process of its own: time, CPU, memory, and what it printed; cut off at a limit."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from measure import ROOT


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


def watched(command: Sequence[str], limit_s: float, folder: Path = ROOT) -> Run:
    """Run `command` in `folder`, and kill it with all that it started once `limit_s` is over."""
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
        alarm = threading.Timer(limit_s, stop)
        alarm.start()
        try:
            _, status, used = os.wait4(process.pid, 0)
        finally:
            alarm.cancel()
        wall_s = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        errors.seek(0)
        ended = None if late.is_set() else process.returncode
        cpu_s = used.ru_utime + used.ru_stime
        return Run(wall_s, cpu_s, used.ru_maxrss / 1024, ended, output.read(), errors.read())
