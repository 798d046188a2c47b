"""The workers on this machine: processes that execute the runs of a study."""

from __future__ import annotations

import os
import selectors
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Self

import msgspec

from robochoc.experiments.frames import FrameBuffer, write_frame
from robochoc.experiments.task import Row, Status, Task
from robochoc.system.signals import signals_delayed

SETUP_S = 60.0
"""The seconds beyond a run's time limit, for reading, compiling and ending, after which its worker is killed."""
LEAVING_S = 5.0
"""The seconds in which a worker without a task may end by itself."""
_CHUNK = 1 << 16


class LocalWorkers:
    """Processes on this machine. Each has one bundle of tasks at a time, which are runs on the same problem.

    If a worker dies or does not finish in time, its current task is lost, and other workers continue with its other
    tasks.
    """

    def __init__(self, count: int, memory_mb: int | None = None) -> None:
        self._count = count
        self._memory_mb = memory_mb
        self._selector = selectors.DefaultSelector()
        self._workers: list[_Worker] = []

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all workers and their tasks."""
        for worker in self._workers:
            worker.end(busy=bool(worker.tasks))
        self._selector.close()

    @property
    def pids(self) -> list[int]:
        """The ids of the workers' processes."""
        return [worker.pid for worker in self._workers]

    def rows(self, bundles: Iterable[Sequence[Task]]) -> Iterator[tuple[Task, Row]]:
        """Yield the row of each task as soon as the task is finished."""
        waiting = deque(deque(bundle) for bundle in bundles if bundle)
        while waiting or any(worker.tasks for worker in self._workers):
            self._hand_out(waiting)
            for key, _ in self._selector.select(self._patience_s()):
                yield from self._receive(key.data, waiting)
            for worker in [one for one in self._workers if one.is_late]:
                task = worker.tasks.popleft()
                self._replace(worker, waiting, busy=True)
                yield task, _late(task)

    def _hand_out(self, waiting: deque[deque[Task]]) -> None:
        """Give each idle worker a bundle, and start workers up to the allowed number."""
        while waiting and len(self._workers) < self._count:
            worker = _Worker(self._memory_mb)
            self._workers.append(worker)
            self._selector.register(worker.connection, selectors.EVENT_READ, worker)
        for worker in self._workers:
            if waiting and not worker.tasks:
                worker.give(waiting.popleft())

    def _patience_s(self) -> float | None:
        left = [worker.deadline - time.monotonic() for worker in self._workers if worker.deadline is not None]
        return max(0.0, min(left)) if left else None

    def _receive(self, worker: _Worker, waiting: deque[deque[Task]]) -> Iterator[tuple[Task, Row]]:
        try:
            received = worker.connection.recv(_CHUNK)
        except OSError:
            received = b""
        for content in worker.frames.feed(received):
            row = msgspec.json.decode(content, type=Row)
            task = worker.tasks.popleft()
            if row.status == Status.MEMORY:  # the worker ends itself after this row
                self._replace(worker, waiting)
            else:
                worker.next()
            yield task, row
        if not received and worker in self._workers:
            if worker.tasks:
                yield worker.tasks.popleft(), Row(status=Status.CRASHED, reason=worker.exit_reason())
            self._replace(worker, waiting)

    def _replace(self, worker: _Worker, waiting: deque[deque[Task]], *, busy: bool = False) -> None:
        """End a worker, and put its remaining tasks back into the queue."""
        if worker.tasks:
            waiting.appendleft(worker.tasks)
        self._selector.unregister(worker.connection)
        self._workers.remove(worker)
        worker.end(busy=busy)


class _Worker:
    """One process, its tasks, and the deadline for the first task."""

    def __init__(self, memory_mb: int | None) -> None:
        self.connection, theirs = socket.socketpair()
        self.frames = FrameBuffer()
        self.tasks: deque[Task] = deque()
        self.deadline: float | None = None
        command = [sys.executable, "-P", "-m", "robochoc.experiments.worker"]
        words = [str(theirs.fileno()), str(os.getpid()), str(memory_mb or 0)]
        # In a separate session, so that Ctrl-C on a terminal reaches only the parent, which ends the workers.
        with theirs, signals_delayed():
            self._process = subprocess.Popen(  # noqa: S603 - our own module
                [*command, *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )

    @property
    def pid(self) -> int:
        """The id of the process."""
        return self._process.pid

    def give(self, tasks: deque[Task]) -> None:
        """Give the worker a bundle. Each task is sent when the row of the previous task has arrived."""
        self.tasks = tasks
        self.next()

    def next(self) -> None:
        """Send the next task, if there is one."""
        self.deadline = None
        if not self.tasks:
            return
        limit_s = self.tasks[0].limits.timeout
        self.deadline = None if limit_s is None else time.monotonic() + limit_s + SETUP_S
        with suppress(OSError):  # the worker ended after its last row, as its closed socket will show
            write_frame(self.connection, msgspec.json.encode(self.tasks[0]))

    @property
    def is_late(self) -> bool:
        """True if the current task has taken too long."""
        return self.deadline is not None and time.monotonic() > self.deadline

    def exit_reason(self) -> str:
        """Return the reason why there is no row for the current task."""
        status = self._process.wait()
        if status < 0:
            hint = "; perhaps there was not enough memory" if status == -signal.SIGKILL else ""
            return f"the process was ended by {signal.Signals(-status).name}{hint}"
        return f"the process ended with status {status}"

    def end(self, *, busy: bool) -> None:
        """End the process. Unless it is `busy`, let it end by itself, together with its solver."""
        self.connection.close()
        if not busy:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(LEAVING_S)
        self._process.kill()
        self._process.wait()


def _late(task: Task) -> Row:
    limit_s = task.limits.timeout or 0
    reason = f"it did not stop at its limit of {limit_s:g} s, nor {SETUP_S:g} s later; perhaps its set-up takes long"
    return Row(status=Status.LIMIT, reason=reason, total_s=limit_s + SETUP_S)
