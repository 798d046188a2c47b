"""A Dask cluster on this machine."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support.faults import Run, running
from tests.support.limits import wait_until


class Cluster:
    """A Dask scheduler and workers, as processes of this machine."""

    def __init__(self, stack: ExitStack, home: Path, workers: int = 2) -> None:
        pytest.importorskip("distributed")
        self.file = home / "cluster.json"
        self._stack, self._home = stack, home
        words = ["dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
        self.scheduler = self._start("scheduler", [*words, "--scheduler-file", str(self.file)])
        wait_until(self.file.exists, lambda: f"the scheduler never starts: {self.scheduler.errors()}")
        self.workers = [self.add_worker(f"worker{number}") for number in range(workers)]

    def add_worker(self, name: str) -> Run:
        words = ["dask_worker", "--scheduler-file", str(self.file), "--nthreads", "1", "--no-dashboard", "--no-nanny"]
        return self._start(name, [*words, "--local-directory", str(self._home / f"{name}-files")])

    def _start(self, name: str, words: list[str]) -> Run:
        command = [sys.executable, "-m", f"distributed.cli.{words[0]}", *words[1:]]
        return self._stack.enter_context(running(command, self._home / name))
