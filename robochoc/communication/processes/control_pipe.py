"""A robot's end of its control pipe to the parent."""

from __future__ import annotations

import array
import os
import socket
from collections import deque

import msgspec

from robochoc.communication.control import QUEUES_AT_ONCE, FromParent, FromRobot
from robochoc.communication.processes.queues import READ_BYTES, QueueWriter, unpack
from robochoc.solver.encoding import UnsupportedError

_DECODER = msgspec.msgpack.Decoder(FromParent)
_ENCODER = msgspec.msgpack.Encoder()
"""Made before the fork: once for all robots."""
_ROOM_FOR_FDS = socket.CMSG_SPACE(QUEUES_AT_ONCE * array.array("i").itemsize)
_TRUNCATED = int(socket.MSG_CTRUNC)
"""As a plain number: to combine an enumeration's member makes a new one."""


class ControlPipe:
    """The robot's end of its control pipe: orders, with the queues' ends that come with them, and answers."""

    def __init__(self, name: str, control: socket.socket) -> None:
        self._name = name
        self._socket = control
        self._writer = QueueWriter(control.fileno())
        self._buffer = bytearray()
        self._fds: deque[int] = deque()
        self.ended = False

    def fileno(self) -> int:
        """Return the descriptor, for a selector."""
        return self._socket.fileno()

    def send(self, message: FromRobot) -> bool:
        """Send `message`; return False when a part of it has to wait until the pipe is writable."""
        self._writer.put(_ENCODER.encode(message))
        return self._writer.flush()

    def flush(self) -> bool:
        """Send what had to wait; return False when something still has to."""
        return self._writer.flush()

    def orders(self) -> list[FromParent]:
        """Return all orders that have come. Afterwards `ended` says whether the parent is gone."""
        try:
            chunk, ancillary, flags, _ = self._socket.recvmsg(READ_BYTES, _ROOM_FOR_FDS)
        except BlockingIOError:
            return []
        except ConnectionResetError:
            chunk, ancillary, flags = b"", [], 0
        if flags & _TRUNCATED:
            raise UnsupportedError(
                f"{self._name} needs more open files than the system allows (raise the limit, see 'ulimit -n')"
            )
        for _, _, data in ancillary:
            fds = array.array("i")
            fds.frombytes(data[: len(data) - len(data) % fds.itemsize])
            self._fds.extend(fds)
        self.ended = not chunk
        self._buffer += chunk
        return [_DECODER.decode(body) for body in unpack(self._buffer)]

    def take_fd(self) -> int:
        """Return the next end of a queue that came with the orders."""
        return self._fds.popleft()

    def finish(self) -> None:
        """Send what still waits, and close."""
        os.set_blocking(self.fileno(), True)
        self._writer.flush()
        self._socket.close()
