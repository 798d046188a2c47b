"""Queues between processes: one for each directed edge, with one writer and one reader.

Such a queue is what `multiprocessing.SimpleQueue` is, a `multiprocessing.Pipe`, less what hangs a team when a robot
is killed: it has no lock that a dead process can hold, and each end is open in one process only, so that the other
side sees the end of file at once. `put` never blocks (two robots that fill each other's pipes would wait for ever);
what does not fit yet waits in memory until the pipe is writable. The wire form is that of
`multiprocessing.Connection.send_bytes`: the length, four bytes, network order, then the body.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator

_LENGTH = struct.Struct("!i")
READ_BYTES = 1 << 16
LARGEST_BODY = 1 << 26
"""64 MiB: more than any message of ours, and a bound on what a lying peer can make us allocate."""


class CorruptQueueError(Exception):
    """The data is not a sequence of bodies, or one body is larger than `LARGEST_BODY`."""


def unpack(buffer: bytearray) -> Iterator[bytes]:
    """Take the whole bodies from the front of `buffer`, and leave an unfinished one in it.

    Raises `CorruptQueueError`.
    """
    start = 0
    try:
        while len(buffer) - start >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(buffer, start)
            if not 0 <= length <= LARGEST_BODY:
                raise CorruptQueueError(f"a body of {length} bytes")
            end = start + _LENGTH.size + length
            if len(buffer) < end:
                break
            yield bytes(buffer[start + _LENGTH.size : end])
            start = end
    finally:
        del buffer[:start]


class QueueReader:
    """The end that takes. `fd` is to be watched for readability; it is non-blocking, and owned by this object."""

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self.ended = False
        self._buffer = bytearray()
        os.set_blocking(fd, False)

    def get(self) -> list[bytes]:
        """Return the bodies that one read brings: a writer that never pauses must not keep the reader from others.

        `ended` tells afterwards whether the writer is gone.
        """
        self._read()
        return list(unpack(self._buffer))

    def get_all(self) -> list[bytes]:
        """Return all bodies that are left once the writer has ended."""
        while self._read():
            pass
        return list(unpack(self._buffer))

    def _read(self) -> int:
        try:
            chunk = os.read(self.fd, READ_BYTES)
        except BlockingIOError:
            return 0
        except ConnectionResetError:
            chunk = b""
        self.ended = not chunk
        self._buffer += chunk
        return len(chunk)

    def close(self) -> None:
        """Close the own end."""
        os.close(self.fd)


class QueueWriter:
    """The end that puts. Non-blocking: `put` keeps what the pipe does not take, `flush` tries again.

    `fd` is None as long as the queue has not been opened; what is put before then waits.
    """

    def __init__(self, fd: int | None = None) -> None:
        self.fd: int | None = None
        self.broken = False
        """The reader is gone; what is put from now on is dropped."""
        self._waiting = bytearray()
        if fd is not None:
            self.open(fd)

    def open(self, fd: int) -> None:
        """Begin to write to `fd`, which this object owns from now on."""
        os.set_blocking(fd, False)
        self.fd = fd

    def put(self, body: bytes) -> None:
        """Add a body; it travels with the next `flush`."""
        if not self.broken:
            self._waiting += _LENGTH.pack(len(body))
            self._waiting += body

    def flush(self) -> bool:
        """Write as much as the pipe takes; True when nothing waits any more (for a pipe that is open)."""
        if self.fd is None:
            return True
        try:
            while self._waiting:
                del self._waiting[: os.write(self.fd, self._waiting)]
        except BlockingIOError:
            return False
        except (BrokenPipeError, ConnectionResetError):
            self.broken = True
            self._waiting.clear()
        return True

    def close(self) -> None:
        """Close the own end; the reader sees the end of file after what has been written."""
        if self.fd is not None:
            os.close(self.fd)
            self.fd = None
