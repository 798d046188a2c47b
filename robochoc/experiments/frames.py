"""Frames on a socket between a study and its workers: a length of four bytes, then the content."""

from __future__ import annotations

import socket
import struct

_LENGTH = struct.Struct("!I")
_CHUNK = 1 << 16


def write_frame(connection: socket.socket, content: bytes) -> None:
    """Send a frame. Raises `OSError`."""
    connection.sendall(_LENGTH.pack(len(content)) + content)


def read_frame(connection: socket.socket) -> bytes | None:
    """Wait for a frame and return its content, or None if the other end is closed."""
    frames = FrameBuffer()
    while True:
        received = connection.recv(_CHUNK if frames.missing is None else frames.missing)
        if not received:
            return None
        for content in frames.feed(received):
            return content


class FrameBuffer:
    """Joins received pieces into frames."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    @property
    def missing(self) -> int | None:
        """The minimum number of bytes missing in the current frame, or None if it is complete."""
        length = _LENGTH.unpack_from(self._buffer)[0] if len(self._buffer) >= _LENGTH.size else 0
        return max(0, _LENGTH.size + length - len(self._buffer)) or None

    def feed(self, received: bytes) -> list[bytes]:
        """Add `received` bytes, and return the contents of all frames that are now complete."""
        self._buffer += received
        whole = []
        while len(self._buffer) >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._buffer)
            end = _LENGTH.size + length
            if len(self._buffer) < end:
                break
            whole.append(bytes(self._buffer[_LENGTH.size : end]))
            del self._buffer[:end]
        return whole
