"""Output that does not wait for its reader, so that an unread pipe or a stopped terminal does not delay a run.

Bytes that cannot be written at once are buffered in memory, and a thread writes them. The thread exists only while the
buffer is not empty, so it never exists in a program whose output is read without delay.
"""

from __future__ import annotations

import atexit
import io
import os
import select
import stat
import sys
import threading
from collections import deque
from contextlib import suppress

from robochoc.system.posix import IS_POSIX

TYPE_CHECKING = False  # see robochoc/__init__.py
if TYPE_CHECKING:
    from typing_extensions import Buffer

MAX_WAITING = 1 << 20
"""The maximum number of bytes buffered for standard error. Further lines are dropped and counted."""
PATIENCE_S = 2.0
"""How long the program waits at its end for a reader of standard error that reads nothing, in seconds."""
_PIECE = 4096


class BackgroundWriter:
    """Writes to the descriptor `target` without waiting, up to `limit` bytes ahead of the reader.

    In a forked process, the buffer is initially empty.
    """

    def __init__(self, target: int, limit: int) -> None:
        self._target = target
        self._limit = limit
        self._direct = _not_blocking(target)
        self._begin()

    def _begin(self) -> None:
        self._owner = os.getpid()
        self._waiting: deque[bytes] = deque()
        self._size = 0
        self._error: OSError | None = None
        self._has_thread = self._is_closed = False
        self._changed = threading.Condition()

    def write(self, content: bytes) -> bool:
        """Write `content` now or later. If the buffer is full, write nothing and return False.

        Raises:
            OSError: if this or earlier content cannot be written.
        """
        if self._owner != os.getpid():
            self._begin()
        with self._changed:
            if self._error:
                raise self._error
            if self._waiting and self._size + len(content) > self._limit:
                return False
            rest = content if self._waiting else content[self._written_now(content) :]
            if rest:
                self._waiting.append(rest)
                self._size += len(rest)
            if self._waiting and not self._has_thread:
                self._has_thread = True
                threading.Thread(target=self._write_waiting, daemon=True).start()
        return True

    def finish(self, patience_s: float) -> bool:
        """Wait until everything is written. Return False if the reader has read nothing for `patience_s` seconds.

        Raises:
            OSError: if the content cannot be written.
        """
        if self._owner != os.getpid():
            return True
        with self._changed:
            while self._waiting and self._changed.wait(patience_s):
                pass
            if self._error:
                raise self._error
            return not self._waiting

    def close(self) -> None:
        """Close the `target` as soon as the buffer is empty."""
        with self._changed:
            self._is_closed = True
            if not self._has_thread:
                self._close()

    def _close(self) -> None:
        os.close(self._target)
        if self._direct is not None:
            os.close(self._direct)

    def _written_now(self, content: bytes) -> int:
        """Write as much as possible without waiting, and return the number of bytes written."""
        done = 0
        while self._direct is not None and done < len(content):
            try:
                done += os.write(self._direct, content[done:])
            except BlockingIOError:
                break
        return done

    def _write_waiting(self) -> None:
        """Write the buffer in small pieces, so that the reader's progress is noticed."""
        while True:
            error = None
            with self._changed:
                if not self._waiting:
                    self._has_thread = False
                    if self._is_closed:
                        self._close()
                    return
                first = self._waiting[0]
            try:
                done = os.write(self._target, first[:_PIECE])
            except BlockingIOError:  # another process has made the target non-blocking
                select.select([], [self._target], [])
                continue
            except OSError as failed:
                error, done = failed, 0
            with self._changed:
                self._size -= done
                if done < len(first):
                    self._waiting[0] = first[done:]
                else:
                    self._waiting.popleft()
                if error:
                    self._waiting.clear()
                    self._error = error
                self._changed.notify_all()


def _not_blocking(target: int) -> int | None:
    """Return a descriptor of the same file, pipe or terminal with non-blocking writes, or None if that is impossible.

    Making `target` itself non-blocking would affect the other processes that share it.
    """
    try:
        if stat.S_ISREG(os.fstat(target).st_mode):  # opened again, it would be written from its beginning
            return os.dup(target)
        if not IS_POSIX:
            return None
        return os.open(f"/proc/self/fd/{target}", os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except OSError:  # a socket, another user's terminal, another system
        return None


class _StandardError(io.RawIOBase):
    """Standard error written by a `BackgroundWriter`. Lines that do not fit into the buffer are dropped and counted."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._writer = BackgroundWriter(descriptor, MAX_WAITING)
        self._dropped = 0

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._descriptor

    def isatty(self) -> bool:
        return os.isatty(self._descriptor)

    def write(self, content: Buffer, /) -> int:
        data = bytes(content)
        if self._dropped and self._writer.write(f"robochoc: {self._dropped:,} lines were dropped\n".encode()):
            self._dropped = 0
        if self._dropped or not self._writer.write(data):
            self._dropped += data.count(b"\n")
        return len(data)

    def finish(self) -> None:
        """Wait for as long as the reader makes progress."""
        with suppress(OSError):  # the reader is gone
            self._writer.finish(PATIENCE_S)


class _StandardOutput(io.FileIO):
    """Standard output. Its first error names it. Later writes have no effect, because Python flushes again at exit."""

    _has_failed = False

    def write(self, content: Buffer, /) -> int:
        if self._has_failed:
            return len(bytes(content))
        try:
            return super().write(content)
        except OSError as error:
            self._has_failed = True
            error.filename = "standard output"
            raise


_REPLACED: list[object] = []
"""Python's original streams. Deleting them would close their descriptors."""


def prepare_standard_streams() -> None:
    """Make errors of `sys.stdout` name it, and writes to `sys.stderr` independent of their reader. Not on Windows."""
    if not IS_POSIX:  # consoles have their own streams
        return
    _REPLACED.extend((sys.stdout, sys.stderr))
    with suppress(OSError, ValueError):
        old = sys.stdout
        content = io.BufferedWriter(_StandardOutput(old.fileno(), "w", closefd=False))
        sys.stdout = io.TextIOWrapper(content, old.encoding, old.errors, line_buffering=old.isatty())
    _unblock_standard_error()


def _unblock_standard_error() -> None:
    try:
        descriptor = sys.stderr.fileno()
        mode = os.fstat(descriptor).st_mode
    except (OSError, ValueError):
        return
    if not (stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or os.isatty(descriptor)):
        return
    raw = _StandardError(descriptor)
    sys.stderr = io.TextIOWrapper(raw, sys.stderr.encoding, sys.stderr.errors, write_through=True)
    atexit.register(raw.finish)
