"""A job: work in a thread of its own, with the processes that it starts one after the other."""

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
from robochoc.app.log import noted

LOOK_S = 0.2
"""Whoever watches a process is asked so often to look how far it is."""
_PAUSES_S = (0.001, 0.05)
"""The first and the longest pause between two looks whether a process has ended."""
_JOIN_S = 0.1
"""A job that waits for others looks so often whether it was ended itself."""
END_S = 1.5
"""Jobs that are ended together have so long to say how they ended. Their processes are killed at once."""
AT_ONCE = ((0.0, signal.SIGKILL),)
"""How a job stops that has nothing to tell: it is killed."""

T = TypeVar("T")
Call = Callable[[Callable[[], None]], object]
"""Calls something, perhaps later and in another thread."""
Over = Callable[[str], object]
"""Is told once, in the job's thread, that it did not come to its end, and why; empty: somebody has ended it."""


class EndedError(Exception):
    """The job was ended."""


class LateError(Exception):
    """A process has taken too long, and was ended."""


def call_here() -> Call:
    """Return what calls something in the event loop that runs here. Without one: at once, in whatever thread."""
    try:
        loop = asyncio.get_running_loop()
    except RuntimeError:
        return lambda does: does()

    def call(does: Callable[[], None]) -> None:
        with suppress(RuntimeError):  # the loop is closed: nobody listens any more
            loop.call_soon_threadsafe(does)

    return call


class Job(Generic[T]):
    """Work that is carried out in a thread. `work` gets the job, by which it starts processes.

    Whatever goes wrong in it, it comes to an end: `future` then has the exception, `over` is told, and what was
    unforeseen stands in the file of errors.

    Args:
        name: What the job is, for the file of errors.
        work: The work.
        over: Is told if the work did not come to its end.
        folder: The folder that the job writes to, or is about, if there is one: see `end_jobs_in`.
        stopping: The signals that its process gets when it is to stop, each with the seconds after which it is sent.
    """

    def __init__(
        self,
        name: str,
        work: Callable[[Job[T]], T],
        *,
        over: Over | None = None,
        folder: Path | None = None,
        stopping: tuple[tuple[float, int], ...] = AT_ONCE,
    ) -> None:
        self.name, self.folder = name, folder
        self.future: Future[T] = Future()
        self.over = over
        self._does, self._stopping = work, stopping
        self._lock = threading.Lock()
        self._is_told = False
        self._news = threading.Event()
        self._process: GroupProcess | None = None
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self.stopped_at: float | None = None
        """When somebody has asked it to stop, on the monotonic clock."""
        self.is_ended = False
        """Whether somebody has ended it."""

    @property
    def pid(self) -> int | None:
        """The process that runs at present, the first of its group."""
        process = self._process
        return process.pid if process else None

    @property
    def is_alive(self) -> bool:
        """Whether its thread is at work."""
        return self._thread.is_alive()

    def start(self) -> Self:
        """Begin."""
        self.future.set_running_or_notify_cancel()
        with _LOCK:
            _ALIVE.add(self)
        try:
            self._thread.start()
        except RuntimeError as no_thread:
            self._fail(no_thread)
            self._forget()
        return self

    def stop(self) -> None:
        """Ask it to stop, in the way that it has. Returns at once."""
        if self.stopped_at is None:
            self.stopped_at = time.monotonic()
        self._news.set()

    def end(self) -> None:
        """End it now: its process is killed, and it starts no other one. Returns at once."""
        self.is_ended = True
        with self._lock:
            process = self._process
        if process:
            process.kill()
        self._news.set()

    def give_up(self) -> None:
        """Say that it has ended, though its thread still computes."""
        self._tell("")

    def join(self, within_s: float | None = None) -> bool:
        """Wait until its thread has ended; return whether it has."""
        if self._thread.ident is not None:
            self._thread.join(within_s)
        return not self.is_alive

    def wait_for(self, others: Iterable[Job[Any]]) -> None:
        """Wait, in this job, until others have ended. Raises `EndedError` if somebody ends it meanwhile."""
        for other in others:
            while not other.join(_JOIN_S):
                self.check()

    def check(self) -> None:
        """Raise `EndedError` if somebody has ended it."""
        if self.is_ended:
            raise EndedError

    def run(
        self, command: Command, look: Callable[[], object] | None = None, within_s: float | None = None
    ) -> Finished:
        """Run a process to its end.

        Args:
            command: The process.
            look: Is called again and again meanwhile.
            within_s: The process is ended after so long.

        Raises:
            EndedError: if somebody has ended the job.
            LateError: if the process has taken too long.
            OSError: if it cannot be started.
        """
        with self._lock:
            self.check()
            self._process = process = GroupProcess(command)
        try:
            late = self._watch(process, look, within_s)
        finally:
            with self._lock:
                self._process = None
            finished = process.finish()
        self.check()
        if late:
            raise LateError
        return finished

    def _watch(self, process: GroupProcess, look: Callable[[], object] | None, within_s: float | None) -> bool:
        """Watch a process until it has ended; return whether it was too late."""
        began = looked = time.monotonic()
        said = 0
        pause_s, longest_s = _PAUSES_S
        while not process.has_ended and not self.is_ended:
            now = time.monotonic()
            if within_s is not None and now - began > within_s:
                return True
            while self.stopped_at is not None and said < len(self._stopping):
                after_s, number = self._stopping[said]
                if now - self.stopped_at < after_s:
                    break
                process.kill() if number == signal.SIGKILL else process.signal(number)
                said += 1
            if look and now - looked >= LOOK_S:
                look()
                looked = now
            self._news.wait(pause_s)
            self._news.clear()
            pause_s = min(2 * pause_s, longest_s)
        return False

    def _work(self) -> None:
        try:
            self.check()
            result = self._does(self)
        except EndedError as ended:
            self._tell("")
            self.future.set_exception(ended)
        except Exception as fault:  # noqa: BLE001 - told, and kept in the file of errors
            self._fail(fault)
        else:
            self.future.set_result(result)
        finally:
            self._forget()

    def _fail(self, fault: Exception) -> None:
        self._tell(noted(fault, self.name))
        self.future.set_exception(fault)

    def _tell(self, why: str) -> None:
        with self._lock:
            was_told, self._is_told = self._is_told, True
        if self.over and not was_told:
            try:
                self.over(why)
            except Exception as fault:  # noqa: BLE001 - the job comes to its end all the same
                noted(fault, self.name)

    def _forget(self) -> None:
        with _LOCK:
            _ALIVE.discard(self)


_LOCK = threading.Lock()
_ALIVE: set[Job[Any]] = set()


def jobs_alive() -> list[Job[Any]]:
    """Return all jobs that have begun and have not ended."""
    with _LOCK:
        return [*_ALIVE]


def end_all(within_s: float = END_S) -> None:
    """End all jobs: the server ends. It returns in time, whatever they do; threads end with the process."""
    _end(jobs_alive(), within_s)


def end_jobs_in(folder: Path) -> list[Job[Any]]:
    """End the jobs that are about a folder, or about one in it. Returns at once; return them."""
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
