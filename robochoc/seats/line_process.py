"""Outside programs that read and write lines, within limits of time and size.

The programs are untrusted. A program may be late, stopped, silent, write without end, never read, or die: `exchange`
returns at its deadline at the latest, and `end` kills the program with all processes of its session.
"""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import IO

from robochoc.solver.errors import UnsupportedError
from robochoc.system.signals import signal_when_orphaned, signals_delayed

LINE_BYTES = 1 << 16
"""The maximum length of a line from a program, in bytes."""
ROUND_BYTES = 1 << 20
"""The maximum number of bytes that a program may write in a round."""
ROUND_LINES = 200
"""The maximum number of lines that a program may write in a round."""
WAIT_S = 3600.0
"""The longest single wait, in seconds: the system accepts no arbitrarily long one."""
_CHUNK = 1 << 16


class LineProcess:
    """A running program.

    Args:
        command: The program and its arguments; no shell is used.

    Attributes:
        ended: True if the program has closed its output, or was ended.
        flooding: True if it was ended because it wrote too much in a round.
        oversized: The number of lines in this round that were longer than `LINE_BYTES`; they were dropped.

    Raises:
        UnsupportedError: if the program cannot be started.
    """

    def __init__(self, command: Sequence[str]) -> None:
        try:
            with signals_delayed():
                self._process = subprocess.Popen(  # noqa: S603 - the user's command
                    [*command],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,  # its text must not reach the terminal
                    start_new_session=True,  # so that all its processes can be ended
                    preexec_fn=_end_with_the_game,  # noqa: PLW1509 - it only calls the kernel
                )
        except OSError as error:
            raise UnsupportedError(f"{command[0]} cannot be started: {error.strerror}") from error
        self.output, self.input = _pipe(self._process.stdout), _pipe(self._process.stdin)
        os.set_blocking(self.output.fileno(), False)
        os.set_blocking(self.input.fileno(), False)
        self._unsent = bytearray()
        self._unread = bytearray()
        self._skips = False
        self.ended = self.flooding = False
        self.begin_round()

    def begin_round(self) -> None:
        """Reset the counts of a round."""
        self.oversized = self._bytes = self._lines = 0

    def send(self, line: bytes) -> None:
        """Queue a line for the program."""
        if not self.ended:
            self._unsent += line

    @property
    def has_unsent(self) -> bool:
        """True if the program has not read all lines yet, and is still running."""
        return bool(self._unsent) and not self.ended

    def write(self) -> None:
        """Write as much as the program reads. It may have closed its input, which is no fault in itself."""
        try:
            written = os.write(self.input.fileno(), self._unsent[:_CHUNK])
        except BlockingIOError:
            return
        except OSError:
            self._unsent.clear()
            return
        del self._unsent[:written]

    def read(self) -> list[bytes]:
        """Return the complete lines that the program has written."""
        try:
            found = os.read(self.output.fileno(), _CHUNK)
        except BlockingIOError:
            return []
        except OSError:
            found = b""
        if not found:
            self.ended = True
            return []
        self._bytes += len(found)
        self._unread += found
        lines: list[bytes] = []
        while (end := self._unread.find(b"\n")) >= 0:
            self._take(bytes(self._unread[:end]), lines)
            del self._unread[: end + 1]
        if len(self._unread) > LINE_BYTES:
            self._unread.clear()
            self._skips = True
        if self._bytes > ROUND_BYTES or self._lines > ROUND_LINES:
            self.flooding = True
            self.end()
        return lines

    def _take(self, line: bytes, lines: list[bytes]) -> None:
        """Add a line, unless it is empty or too long."""
        self._lines += 1
        if self._skips or len(line) > LINE_BYTES:
            self.oversized += 1
        elif line.strip():
            lines.append(line)
        self._skips = False

    def end(self) -> None:
        """Kill the program and all processes of its session, also if they are stopped."""
        self.ended = True
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.wait()
        for pipe in (self.input, self.output):
            with suppress(OSError):
                pipe.close()


def _end_with_the_game() -> None:
    """In the new process: let the kernel end it when robochoc is killed (Linux), even if it does not read its input."""
    signal_when_orphaned(signal.SIGKILL)


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None  # noqa: S101 - for mypy: all are pipes
    return pipe


def exchange(processes: Mapping[str, LineProcess], accept: Callable[[str, bytes], bool], timeout_s: float) -> None:
    """Write all queued lines, and pass the lines of each program to `accept` until it returns True.

    Args:
        processes: The programs, by name.
        accept: Processes a line from the program with this name. It returns True if it needs no more lines.
        timeout_s: The time limit for all programs together, in seconds.
    """
    deadline = time.monotonic() + timeout_s
    waiting = {name: one for name, one in processes.items() if not one.ended}
    with selectors.DefaultSelector() as selector:
        for name, one in waiting.items():
            selector.register(one.output, selectors.EVENT_READ, name)
            if one.has_unsent:
                selector.register(one.input, selectors.EVENT_WRITE, name)
        while waiting and (left := deadline - time.monotonic()) > 0:
            for key, _ in selector.select(min(left, WAIT_S)):
                one = processes[key.data]
                if key.data not in waiting:
                    continue
                if key.fileobj is one.input:
                    one.write()
                    if not one.has_unsent:
                        selector.unregister(one.input)
                    continue
                lines = one.read()
                answered = any(accept(key.data, line) for line in lines)
                if answered or one.ended:
                    del waiting[key.data]
                    _forget(selector, one.output)
                    _forget(selector, one.input)  # the rest of the lines is written in the next round


def _forget(selector: selectors.BaseSelector, pipe: object) -> None:
    with suppress(KeyError, ValueError):
        selector.unregister(pipe)  # type: ignore[arg-type]
