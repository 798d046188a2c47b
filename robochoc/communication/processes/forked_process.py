"""A forked process that writes to as little inherited memory as possible.

`multiprocessing.Process` checks all earlier processes whenever it starts one, and each forked process destroys the
objects inherited for all other processes. Both costs grow with the square of the team: 3 s and 2 GB for 1,000 robots.
"""

from __future__ import annotations

import gc
import os
import select
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import NoReturn, Protocol

from robochoc.system.garbage import resume_in_child


class ChildProcess(Protocol):
    """The runtime's interface to a robot's process, for every start method."""

    @property
    def pid(self) -> int | None:
        """The process ID."""

    @property
    def sentinel(self) -> int:
        """A descriptor that becomes readable when the process ends."""

    @property
    def exitcode(self) -> int | None:
        """The exit status, or the negative number of the signal that killed the process. None: the process is alive."""

    def start(self) -> None:
        """Start the process. Raises `OSError` if the system does not allow it."""

    def kill(self) -> None:
        """Kill the process by SIGKILL. Has no effect if the process has ended."""

    def join(self) -> None:
        """Wait for the end of the process."""

    def close(self) -> None:
        """Release the resources of the process. It must have ended, or never have been started."""


class ForkedProcess:
    """A process that runs `act` after it is started, and ends. See `ChildProcess`.

    The standard input is empty. If `act` raises an error, it is printed and the status is 1, or the one of
    `SystemExit`.

    Args:
        act: The function to run.
        kept: The descriptors that `act` needs.
        closed: Ranges of descriptors that the process closes, except `kept`. They are read at the start.
    """

    def __init__(self, act: Callable[[], None], kept: Iterable[int], closed: Sequence[range] = ()) -> None:
        _flush()
        self.pid: int | None = None
        self._act = act
        self._exitcode: int | None = None
        self.sentinel, its_end = os.pipe()
        self.kept = sorted([*kept, its_end])
        self._its_end = its_end
        self._closed = closed

    def start(self) -> None:
        """See `ChildProcess`."""
        pid = os.fork()
        if not pid:
            self._run()
        self.pid = pid
        os.close(self._its_end)

    def _run(self) -> NoReturn:
        """Run `act` in the forked process, and end the process without cleaning up objects of the parent."""
        status = 1
        try:
            gc.freeze()  # a garbage collection would write to inherited memory
            resume_in_child()
            self._close()
            self._act()
            status = 0
        except SystemExit as leave:
            status = leave.code if isinstance(leave.code, int) else int(leave.code is not None)
        except BaseException:  # noqa: BLE001 - the process ends here
            traceback.print_exc()
        finally:
            with suppress(OSError):
                _flush()
            os._exit(status)

    def _close(self) -> None:
        for inherited in self._closed:
            start = inherited.start
            for fd in self.kept:
                if start <= fd < inherited.stop:
                    os.closerange(start, fd)
                    start = fd + 1
            os.closerange(start, inherited.stop)
        empty = os.open(os.devnull, os.O_RDONLY)
        os.dup2(empty, 0)
        os.close(empty)

    @property
    def exitcode(self) -> int | None:
        """See `ChildProcess`."""
        if self._exitcode is None:
            self._wait(os.WNOHANG)
        return self._exitcode

    def kill(self) -> None:
        """See `ChildProcess`."""
        if self.pid is not None and self.exitcode is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

    def join(self) -> None:
        """See `ChildProcess`."""
        if self._exitcode is None:
            self._wait(0)

    def close(self) -> None:
        """See `ChildProcess`."""
        os.close(self.sentinel)
        if self.pid is None:
            os.close(self._its_end)

    def _wait(self, options: int) -> None:
        if self.pid is None:
            return
        with suppress(ChildProcessError):  # other code has already waited for this process
            pid, status = os.waitpid(self.pid, options)
            if pid:
                self._exitcode = os.waitstatus_to_exitcode(status)


def _flush() -> None:
    """Flush the standard streams, so that buffered output is not printed twice."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError):  # the stream does not exist, or is closed
            stream.flush()


def ended_of(sentinels: Iterable[int], patience_s: float) -> list[int]:
    """Wait at most `patience_s` seconds, and return those `sentinels` whose processes have ended."""
    poll = select.poll()
    for sentinel in sentinels:
        poll.register(sentinel, select.POLLIN)
    return [sentinel for sentinel, _ in poll.poll(patience_s * 1000)]


def ranges_of(descriptors: Iterable[int]) -> Iterator[range]:
    """Yield `descriptors` as the smallest number of ranges."""
    start = end = -1
    for fd in sorted(descriptors):
        if fd != end:
            yield from (range(start, end),) * (end > start)
            start = fd
        end = fd + 1
    yield from (range(start, end),) * (end > start)
