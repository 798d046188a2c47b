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

    def wait_for_blocks(self, run: Run) -> None:
        """Wait until each worker has begun its block of the team that `run` solves."""
        from distributed import Client  # noqa: PLC0415 - an extra

        with Client(scheduler_file=str(self.file), set_as_default=False) as client:
            wait_until(
                lambda: sum(map(len, client.call_stack().values())) == len(self.workers) or run.is_over,
                lambda: f"the blocks never run: {run.errors()}",
            )
        assert not run.is_over, run.errors()

    def is_idle(self) -> bool:
        """Return whether no worker executes a task."""
        from distributed import Client  # noqa: PLC0415 - an extra

        with Client(scheduler_file=str(self.file), set_as_default=False) as client:
            return not any(client.call_stack().values())

    def wait_until_idle(self) -> None:
        wait_until(self.is_idle, "the workers continue")

    def _start(self, name: str, words: list[str]) -> Run:
        command = [sys.executable, "-m", f"distributed.cli.{words[0]}", *words[1:]]
        return self._stack.enter_context(running(command, self._home / name))
