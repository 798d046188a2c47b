"""Queues between processes: one queue per directed edge, with one writer and one reader.

Like `multiprocessing.SimpleQueue`, such a queue is a `multiprocessing.Pipe`, but a killed robot cannot block it: there
is no lock that a dead process could hold, and each end is open in only one process, so that the other side sees the end
of file at once. `put` never blocks, since two robots that fill each other's pipes would wait forever; bytes that do not
fit wait in memory until the pipe is writable. The format is that of `multiprocessing.Connection.send_bytes`: the length
in four bytes in network order, then the body.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from typing import NamedTuple

from robochoc.system.errors import RobochocError

_LENGTH = struct.Struct("!i")
_STAMPED = struct.Struct("!iIQ")
_STAMP_BYTES = _STAMPED.size - _LENGTH.size
READ_BYTES = 1 << 16
LARGEST_BODY = 1 << 26
"""64 MiB. This is larger than any message of ours, and limits the memory that an invalid length can allocate."""


class CorruptQueueError(RobochocError):
    """Raised if the data is not a sequence of bodies, or a body is larger than `LARGEST_BODY`."""


class Stamped(NamedTuple):
    """A protocol message in transit: the epoch in which it was sent, the sender's clock, and the content."""

    epoch: int
    clock: int
    content: bytes


def unpack_stamped(data: bytes) -> tuple[list[Stamped], bytes]:
    """Return the complete messages at the front of `data`, and the remaining bytes, the beginning of another message.

    This is a faster `unpack` for many small messages, for which each call and each copy counts.

    Raises `CorruptQueueError`.
    """
    found = []
    start, size = 0, len(data)
    while size - start >= _STAMPED.size:
        length, epoch, clock = _STAMPED.unpack_from(data, start)
        if not _STAMP_BYTES <= length <= LARGEST_BODY:
            raise CorruptQueueError(f"a message of {length} bytes")
        end = start + _LENGTH.size + length
        if size < end:
            break
        found.append(Stamped(epoch, clock, data[start + _STAMPED.size : end]))
        start = end
    return found, data[start:]


def unpack(buffer: bytearray) -> Iterator[bytes]:
    """Remove the complete bodies from the front of `buffer`, and yield these bodies.

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


def _missing(beginning: bytes) -> int:
    """Return the number of bytes that are missing after the `beginning` of a message or of its header."""
    if len(beginning) < _STAMPED.size:
        return _STAMPED.size - len(beginning)
    (length,) = _LENGTH.unpack_from(beginning)
    return _LENGTH.size + int(length) - len(beginning)


class QueueReader:
    """The read end. `fd` must be watched for readability; it is non-blocking, and owned by this object."""

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self.ended = False
        self._buffer = bytearray()
        self._left: list[bytes] = []
        self._missing = 0
        os.set_blocking(fd, False)

    def get(self) -> list[bytes]:
        """Return the bodies from one read, and not more, so that a fast writer does not block other queues.

        Afterwards `ended` is true if the writer is gone.
        """
        self._read()
        return list(unpack(self._buffer))

    def get_stamped(self) -> list[Stamped]:
        """Return the messages from one read. See `get`. A queue contains either bodies or stamped messages."""
        chunk = self._chunk()
        if self._left:
            self._left.append(chunk)
            self._missing -= len(chunk)
            if self._missing > 0:  # join the parts of a large message only once
                return []
            chunk = b"".join(self._left)
        found, left = unpack_stamped(chunk)
        self._left = [left] if left else []
        self._missing = _missing(left)
        return found

    def get_all(self) -> list[bytes]:
        """Return all remaining bodies after the writer has ended."""
        while self._read():
            pass
        return list(unpack(self._buffer))

    def _read(self) -> int:
        chunk = self._chunk()
        self._buffer += chunk
        return len(chunk)

    def _chunk(self) -> bytes:
        try:
            chunk = os.read(self.fd, READ_BYTES)
        except BlockingIOError:
            return b""
        except ConnectionResetError:
            chunk = b""
        self.ended = not chunk
        return chunk

    def close(self) -> None:
        """Close the read end."""
        os.close(self.fd)


class QueueWriter:
    """The write end. It is non-blocking: `put` stores bytes that the pipe does not accept, `flush` tries again.

    `fd` is None until the queue is opened. Bodies that are put before wait.
    """

    def __init__(self, fd: int | None = None) -> None:
        self.fd: int | None = None
        self.broken = False
        """True if the reader is gone. Further bodies are then dropped."""
        self._waiting = bytearray()
        if fd is not None:
            self.open(fd)

    def open(self, fd: int) -> None:
        """Start writing to `fd`, which is owned by this object from now on."""
        os.set_blocking(fd, False)
        self.fd = fd

    def put(self, body: bytes) -> None:
        """Add a body to be sent by the next `flush`."""
        if not self.broken:
            self._waiting += _LENGTH.pack(len(body))
            self._waiting += body

    def put_stamped(self, epoch: int, clock: int, content: bytes) -> None:
        """Add a protocol message to be sent by the next `flush`, together with all other waiting messages."""
        if not self.broken:
            self._waiting += _STAMPED.pack(_STAMP_BYTES + len(content), epoch, clock)
            self._waiting += content

    def flush(self) -> bool:
        """Write as much as the pipe accepts. Return True if nothing waits any more, or the queue is not yet open."""
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
        """Close the write end. The reader sees the end of file after all written bytes."""
        if self.fd is not None:
            os.close(self.fd)
            self.fd = None
