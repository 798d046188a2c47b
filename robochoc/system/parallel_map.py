"""Applies a function to items in forked processes.

A forked process has the function and the items in memory, so only results are sent, over a pipe. Each item has a
process of its own: if it dies, no other item is affected, and its memory is free at once.
"""

from __future__ import annotations

import os
import signal
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Generic, Self, TypeVar

from robochoc.system.errors import RobochocError
from robochoc.system.posix import IS_POSIX
from robochoc.system.signals import leave_ctrl_c_to_the_parent, signal_when_orphaned, signals_delayed
from robochoc.system.stopping import STOP, stop_requested

Item = TypeVar("Item")
Result = TypeVar("Result")
CHECK_S = 0.5
"""The interval between two checks for a stop request, in seconds."""


class ChildDiedError(RobochocError):
    """Raised if a process ended without a result."""


class ParallelMap(Generic[Item, Result]):
    """Applies `function` to items in forked processes, and ends all processes when the context is left.

    Args:
        function: The function. It may report progress by calling its second argument with a number.
        jobs: The maximum number of processes at the same time. With 1, and on Windows, the function runs in this
            process.
        show: Called with the number of finished items, and the sum of the last numbers reported for all items.
    """

    def __init__(
        self,
        function: Callable[[Item, Callable[[int], None]], Result],
        jobs: int,
        show: Callable[[int, int], None] | None = None,
    ) -> None:
        self._function, self._jobs, self._show = function, jobs, show
        self._running: list[_Child[Item, Result]] = []
        self._waiting: deque[_Child[Item, Result]] = deque()
        self._finished = self._progress = 0

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(self, *_: object) -> None:
        """End all processes."""
        for child in self._running:
            child.end()

    def results(self, items: Iterable[Item]) -> Iterator[tuple[Item, Result]]:
        """Yield each item with its result, in the order of the items.

        Raises:
            ChildDiedError: if a process ended without a result.
            Exception: any error of the function.
        """
        for item in items:
            if self._jobs == 1 or not IS_POSIX:
                yield item, self._result_here(item)
                continue
            while len(self._running) >= self._jobs:
                self._receive()
            child = _Child(item, self._function)
            self._running.append(child)
            self._waiting.append(child)
            child.start()
            yield from self._ready()
        while self._waiting:
            self._receive()
            yield from self._ready()

    def _result_here(self, item: Item) -> Result:
        """Return the result for `item`, computed in this process."""
        before = self._progress

        def report(number: int) -> None:
            self._progress = before + number
            self._shown()

        result = self._function(item, report)
        self._finished += 1
        self._shown()
        return result

    def _ready(self) -> Iterator[tuple[Item, Result]]:
        """Yield the results that are next in the order of the items."""
        while self._waiting and not self._waiting[0].is_running:
            child = self._waiting.popleft()
            yield child.item, child.result()

    def _receive(self) -> None:
        """Wait for progress or the end of processes, or for a short time."""
        if stop_requested():
            for child in self._running:
                child.request_stop()
        readable = wait([child.connection for child in self._running], CHECK_S)
        for child in [one for one in self._running if one.connection in readable]:
            before = child.progress
            child.receive()
            self._progress += child.progress - before
            if not child.is_running:
                self._running.remove(child)
                self._finished += 1
        self._shown()

    def _shown(self) -> None:
        if self._show:
            self._show(self._finished, self._progress)


class _Child(Generic[Item, Result]):
    """The process of one item."""

    def __init__(self, item: Item, function: Callable[[Item, Callable[[int], None]], Result]) -> None:
        self.item = item
        self.is_running = True
        self.progress = 0
        context = get_context("fork")
        self.connection, self._theirs = context.Pipe(duplex=False)
        arguments = function, item, self._theirs, os.getpid()
        self._process = context.Process(target=_apply, args=arguments, daemon=True)
        self._result: list[Result] = []
        self._error: Exception | None = None
        self._asked = False

    def start(self) -> None:
        """Start the process."""
        with signals_delayed():
            self._process.start()
        self._theirs.close()

    def receive(self) -> None:
        """Receive progress, the result or an error."""
        try:
            received = self.connection.recv()
        except EOFError:
            self._process.join(CHECK_S)
            self.end()
            status = self._process.exitcode
            hint = _HINT if status == -signal.SIGKILL else ""
            self._error = ChildDiedError(f"its process ended with status {status}{hint}")
            return
        if isinstance(received, int):
            self.progress = received
            return
        self._result, self._error = received
        self.end()

    def result(self) -> Result:
        """Return the result. Raises the error of the function, or `ChildDiedError`."""
        if self._error is not None:
            raise self._error
        return self._result[0]

    def request_stop(self) -> None:
        """Send a stop request to the process, once."""
        if not self._asked and self._process.pid and STOP:
            self._asked = True
            with suppress(ProcessLookupError):
                os.kill(self._process.pid, STOP)

    def end(self) -> None:
        """End the process."""
        self.is_running = False
        self.connection.close()
        if self._process.pid:
            self._process.kill()
            self._process.join()


_HINT = "; perhaps there was not enough memory: use fewer jobs, or a smaller limit"


def _apply(
    function: Callable[[Item, Callable[[int], None]], Result], item: Item, connection: Connection, parent: int
) -> None:
    """Send the result of `function`, or its error. This runs in the forked process."""
    leave_ctrl_c_to_the_parent()
    signal_when_orphaned(signal.SIGKILL)
    if os.getppid() != parent:
        return
    try:
        content: tuple[list[Result], Exception | None] = [function(item, connection.send)], None
    except Exception as error:  # noqa: BLE001 - it is raised in the parent
        error.add_note(f"In a process of its own:\n{traceback.format_exc()}")
        content = [], error
    connection.send(content)
