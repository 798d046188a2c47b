"""A robot's end of its control pipe to the parent."""

from __future__ import annotations

import array
import os
import socket
from collections import deque

import msgspec

from robochoc.communication.control import QUEUES_AT_ONCE, FromParent, FromRobot
from robochoc.communication.processes.queues import READ_BYTES, QueueWriter, unpack
from robochoc.solver.errors import UnsupportedError

_DECODER = msgspec.msgpack.Decoder(FromParent)
_ENCODER = msgspec.msgpack.Encoder()
"""Built once, before the fork, for all robots."""
_ROOM_FOR_FDS = socket.CMSG_SPACE(QUEUES_AT_ONCE * array.array("i").itemsize)
_TRUNCATED = int(socket.MSG_CTRUNC)
"""A plain number, because combining enumeration members creates new members."""


class ControlPipe:
    """The robot's end of its control pipe: receives orders with attached queue ends, and sends answers."""

    def __init__(self, name: str, control: socket.socket) -> None:
        self._name = name
        self._socket = control
        self._writer = QueueWriter(control.fileno())
        self._buffer = bytearray()
        self._fds: deque[int] = deque()
        self.ended = False

    def fileno(self) -> int:
        """Return the descriptor, for use in a selector."""
        return self._socket.fileno()

    def send(self, message: FromRobot) -> bool:
        """Send `message`. Return False if a part of it must wait until the pipe is writable."""
        self._writer.put(_ENCODER.encode(message))
        return self._writer.flush()

    def flush(self) -> bool:
        """Send waiting bytes. Return False if some bytes must still wait."""
        return self._writer.flush()

    def orders(self) -> list[FromParent]:
        """Return all received orders. Afterwards `ended` is true if the parent is gone."""
        try:
            chunk, ancillary, flags, _ = self._socket.recvmsg(READ_BYTES, _ROOM_FOR_FDS)
        except BlockingIOError:
            return []
        except ConnectionResetError:
            chunk, ancillary, flags = b"", [], 0
        if flags & _TRUNCATED:
            raise UnsupportedError(
                f"{self._name} needs more open files than the system allows: raise the limit, see 'ulimit -n'"
            )
        for _, _, data in ancillary:
            fds = array.array("i")
            fds.frombytes(data[: len(data) - len(data) % fds.itemsize])
            self._fds.extend(fds)
        self.ended = not chunk
        self._buffer += chunk
        return [_DECODER.decode(body) for body in unpack(self._buffer)]

    def take_fd(self) -> int:
        """Return the next queue end attached to the orders."""
        return self._fds.popleft()

    def finish(self) -> None:
        """Send all waiting bytes, and close the pipe."""
        os.set_blocking(self.fileno(), True)
        self._writer.flush()
        self._socket.close()
