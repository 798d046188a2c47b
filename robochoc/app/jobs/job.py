"""A job: work in a thread, which can start processes one after the other."""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

from robochoc.app.jobs.process import Command, Finished, GroupProcess
from robochoc.app.log import log_error
from robochoc.system.errors import RobochocError

OBSERVE_S = 0.2
"""The interval at which the callback that observes a process is called, in seconds."""
_PAUSES_S = (0.001, 0.05)
"""The first and the longest pause between two checks whether a process has ended, in seconds."""
_JOIN_S = 0.1
"""The interval at which a job that waits for other jobs checks whether it was ended, in seconds."""
END_S = 1.5
"""The time limit in seconds for jobs that are ended together. Their processes are killed at once."""
AT_ONCE = ((0.0, signal.SIGKILL),)
"""The signals for a job without a result: its process is killed at once."""

T = TypeVar("T")
Call = Callable[[Callable[[], None]], object]
"""Calls a function, possibly later and in another thread."""
OnIncomplete = Callable[[str], object]
"""Called once in the job's thread if the job did not complete, with the error, or an empty text if it was ended."""


class EndedError(RobochocError):
    """The job was ended."""


class LateError(RobochocError):
    """A process reached its time limit and was ended."""


def event_loop_caller() -> Call:
    """Return a function that schedules calls in the current event loop, or calls immediately if there is no loop."""
    try:
        loop = asyncio.get_running_loop()
    except RuntimeError:
        return lambda does: does()

    def call(does: Callable[[], None]) -> None:
        with suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(does)

    return call


class Job(Generic[T]):
    """Work in a thread. The function `work` receives the job, which can start processes.

    A job always ends. After an error, `future` contains the exception, and `on_incomplete` is called. Unexpected errors
    are written to the error log.

    Args:
        name: A description of the job, for the error log.
        work: The work.
        on_incomplete: Called if the work was not completed.
        folder: The folder that the job uses, if any; see `end_jobs_in`.
        stopping: The signals that stop the job's process, each with the delay in seconds after which it is sent.
    """

    def __init__(
        self,
        name: str,
        work: Callable[[Job[T]], T],
        *,
        on_incomplete: OnIncomplete | None = None,
        folder: Path | None = None,
        stopping: tuple[tuple[float, int], ...] = AT_ONCE,
    ) -> None:
        self.name, self.folder = name, folder
        self.future: Future[T] = Future()
        self.on_incomplete = on_incomplete
        self._does, self._stopping = work, stopping
        self._lock = threading.Lock()
        self._is_reported = False
        self._news = threading.Event()
        self._process: GroupProcess | None = None
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self.stopped_at: float | None = None
        """The time at which a stop was requested, on the monotonic clock."""
        self.is_ended = False
        """True if the job was ended."""

    @property
    def pid(self) -> int | None:
        """The id of the current process and its group."""
        process = self._process
        return process.pid if process else None

    @property
    def is_alive(self) -> bool:
        """True if the job's thread is running."""
        return self._thread.is_alive()

    def start(self) -> Self:
        """Start the thread."""
        self.future.set_running_or_notify_cancel()
        with _LOCK:
            _ALIVE.add(self)
        try:
            self._thread.start()
        except RuntimeError as no_thread:
            self._fail(no_thread)
            self._unregister()
        return self

    def stop(self) -> None:
        """Request a stop by the `stopping` signals, and return immediately."""
        if self.stopped_at is None:
            self.stopped_at = time.monotonic()
        self._news.set()

    def end(self) -> None:
        """End the job: kill its process, and start no further processes. Returns immediately."""
        self.is_ended = True
        with self._lock:
            process = self._process
        if process:
            process.kill()
        self._news.set()

    def give_up(self) -> None:
        """Report that the job has ended, although its thread is still running."""
        self._report("")

    def join(self, within_s: float | None = None) -> bool:
        """Wait for the thread to end, and return whether it has ended."""
        if self._thread.ident is not None:
            self._thread.join(within_s)
        return not self.is_alive

    def wait_for(self, others: Iterable[Job[Any]]) -> None:
        """Wait in this job's thread until other jobs end. Raises `EndedError` if this job is ended in the meantime."""
        for other in others:
            while not other.join(_JOIN_S):
                self.check()

    def check(self) -> None:
        """Raise `EndedError` if the job was ended."""
        if self.is_ended:
            raise EndedError

    def run(
        self, command: Command, observe: Callable[[], object] | None = None, within_s: float | None = None
    ) -> Finished:
        """Run a process to its end.

        Args:
            command: The process.
            observe: Called repeatedly while the process runs.
            within_s: The time limit for the process, in seconds.

        Raises:
            EndedError: if the job was ended.
            LateError: if the process reached its time limit.
            OSError: if the process cannot be started.
        """
        with self._lock:
            self.check()
            self._process = process = GroupProcess(command)
        try:
            late = self._watch(process, observe, within_s)
        finally:
            with self._lock:
                self._process = None
            finished = process.finish()
        self.check()
        if late:
            raise LateError
        return finished

    def _watch(self, process: GroupProcess, observe: Callable[[], object] | None, within_s: float | None) -> bool:
        """Watch a process until it ends, and return whether it reached its time limit."""
        began = observed = time.monotonic()
        sent = 0
        pause_s, longest_s = _PAUSES_S
        while not process.has_ended and not self.is_ended:
            now = time.monotonic()
            if within_s is not None and now - began > within_s:
                return True
            while self.stopped_at is not None and sent < len(self._stopping):
                after_s, number = self._stopping[sent]
                if now - self.stopped_at < after_s:
                    break
                process.kill() if number == signal.SIGKILL else process.signal(number)
                sent += 1
            if observe and now - observed >= OBSERVE_S:
                observe()
                observed = now
            self._news.wait(pause_s)
            self._news.clear()
            pause_s = min(2 * pause_s, longest_s)
        return False

    def _work(self) -> None:
        try:
            self.check()
            result = self._does(self)
        except EndedError as ended:
            self._report("")
            self.future.set_exception(ended)
        except Exception as fault:  # noqa: BLE001 - reported, and written to the error log
            self._fail(fault)
        else:
            self.future.set_result(result)
        finally:
            self._unregister()

    def _fail(self, fault: Exception) -> None:
        self._report(log_error(fault, self.name))
        self.future.set_exception(fault)

    def _report(self, why: str) -> None:
        with self._lock:
            was_reported, self._is_reported = self._is_reported, True
        if self.on_incomplete and not was_reported:
            try:
                self.on_incomplete(why)
            except Exception as fault:  # noqa: BLE001 - the job must end nevertheless
                log_error(fault, self.name)

    def _unregister(self) -> None:
        with _LOCK:
            _ALIVE.discard(self)


_LOCK = threading.Lock()
_ALIVE: set[Job[Any]] = set()


def jobs_alive() -> list[Job[Any]]:
    """Return all running jobs."""
    with _LOCK:
        return [*_ALIVE]


def end_all(within_s: float = END_S) -> None:
    """End all jobs within a time limit, since the server is shutting down. Their threads end with the process."""
    _end(jobs_alive(), within_s)


def end_jobs_in(folder: Path) -> list[Job[Any]]:
    """End the jobs that use a folder or its subfolders, and return them without waiting for their end."""
    found = [job for job in jobs_alive() if job.folder and (job.folder == folder or folder in job.folder.parents)]
    for job in found:
        job.end()
    return found


def _end(jobs: list[Job[Any]], within_s: float) -> None:
    until = time.monotonic() + within_s
    for job in jobs:
        job.end()
    for job in jobs:
        if not job.join(max(0.0, until - time.monotonic())):
            job.give_up()
