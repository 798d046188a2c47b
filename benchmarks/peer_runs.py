"""One run of any library as a process of its own: time, CPU, memory, and what it printed; cut off at its limits.

The run is started by a small process of this file: the kernel gives a child the peak of memory of who has forked it.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
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
    with tempfile.TemporaryDirectory() as scratch:
        report, output, errors = (Path(scratch) / name for name in ("report", "output", "errors"))
        told = [str(report), str(output), str(errors), str(folder), str(limit_s), str(cpu_s), *command]
        subprocess.run([sys.executable, "-S", __file__, *told], check=True)
        wall_s, used_s, peak_mb, status = json.loads(report.read_text())
        return Run(wall_s, used_s, peak_mb, status, *(one.read_text(errors="replace") for one in (output, errors)))


def main() -> None:
    """Run a command, as `watched` asks."""
    report, output, errors, folder, limit_s, cpu_s, *command = sys.argv[1:]
    with Path(output).open("w") as out, Path(errors).open("w") as err:
        Path(report).write_text(
            json.dumps(_measured(command, folder, (out.fileno(), err.fileno()), float(limit_s), int(cpu_s)))
        )


def _measured(
    command: Sequence[str], folder: str, streams: tuple[int, int], limit_s: float, cpu_s: int
) -> tuple[float, float, float, int | None]:
    late = threading.Event()

    def stop() -> None:
        late.set()
        os.killpg(process.pid, signal.SIGKILL)

    out, err = streams
    began = time.perf_counter()
    process = subprocess.Popen(
        command, cwd=folder, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True
    )
    resource.prlimit(process.pid, resource.RLIMIT_CPU, (cpu_s, cpu_s))
    alarm = threading.Timer(limit_s, stop)
    alarm.start()
    try:
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        wall_s = time.perf_counter() - began
    finally:
        alarm.cancel()
        # Its group still has its number: whoever it has left behind would be in the next one's way.
        os.killpg(process.pid, signal.SIGKILL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    used_s = used.ru_utime + used.ru_stime
    # The kernel's two accounts of CPU differ: some are killed before the second has come to the limit.
    spent = process.returncode == -signal.SIGKILL and 0 < cpu_s <= 2 * used_s
    ended = None if late.is_set() or spent else process.returncode
    return wall_s, used_s, used.ru_maxrss / 1024, ended


if __name__ == "__main__":
    main()
