"""Programs that run in a tree with a mutant: with limited time and memory, and with all that they start."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from tests.mutation.mutants import Mutant

HANG_S = 120
"""The time limit of one test."""
PYTEST = ("-m", "pytest", "-q", "--no-header", "-p", "no:cacheprovider", "-o", f"timeout={HANG_S}")
MEMORY = 8 << 30


@contextlib.contextmanager
def applied(tree: Path, mutant: Mutant) -> Iterator[None]:
    """Change a tree to a mutant, within this context."""
    file = tree / mutant.path
    as_it_was = file.stat()
    file.write_text(mutant.text)
    try:
        yield
    finally:
        file.write_text(mutant.source)
        os.utime(file, ns=(as_it_was.st_atime_ns, as_it_was.st_mtime_ns))


def limited(
    tree: Path, words: Sequence[str], cpu_s: int, environment: Mapping[str, str] | None = None
) -> tuple[int, float, str]:
    """Run Python with `words` in a tree; return the exit code, negative when it was stopped, the CPU time, the output.

    Args:
        tree: The tree whose packages are imported.
        words: The arguments of Python.
        cpu_s: The limit of the CPU time, in seconds.
        environment: More variables of the environment.
    """
    variables = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", **(environment or {})}
    with tempfile.TemporaryFile() as output:
        run = subprocess.Popen(
            [sys.executable, *words],
            cwd=tree,
            env=variables,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        resource.prlimit(run.pid, resource.RLIMIT_CPU, (cpu_s, cpu_s))
        resource.prlimit(run.pid, resource.RLIMIT_DATA, (MEMORY, MEMORY))
        watch = threading.Timer(HANG_S * 15, os.killpg, (run.pid, signal.SIGKILL))
        watch.start()
        _, status, used = os.wait4(run.pid, 0)
        watch.cancel()
        run.returncode = os.waitstatus_to_exitcode(status)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)
        output.seek(0)
        return run.returncode, used.ru_utime + used.ru_stime, output.read().decode(errors="replace")
