"""The parent's side of the connection to one robot: its process and its control pipe."""

from __future__ import annotations

import errno
import socket
import time
from collections.abc import Sequence

import msgspec

from robochoc.communication.control import FromParent, FromRobot
from robochoc.communication.processes.forked_process import ChildProcess, ended_of
from robochoc.communication.processes.process_status import ProcessStatus, describe_end, is_computing, process_status
from robochoc.communication.processes.queues import QueueReader
from robochoc.communication.search_result import RobotsLostError

_DECODER = msgspec.msgpack.Decoder(FromRobot)
_ENCODER = msgspec.msgpack.Encoder()
_UNRESPONSIVE_S = 10.0


class RobotLink:
    """The parent's connection to the robot `name`: its process, and the parent's end of its control pipe.

    `ended`: the process is known to have ended.
    """

    def __init__(self, name: str, process: ChildProcess, control: socket.socket) -> None:
        self.name = name
        self.process = process
        self.control = control
        self.ended = False
        self._reader = QueueReader(control.fileno())

    def receive(self) -> list[FromRobot]:
        """Return the messages from one read of the control pipe. Afterwards `hung_up` is up to date."""
        return [_DECODER.decode(body) for body in self._reader.get()]

    def receive_rest(self) -> list[FromRobot]:
        """Return all remaining messages in the control pipe after the process has ended."""
        return [_DECODER.decode(body) for body in self._reader.get_all()]

    @property
    def hung_up(self) -> bool:
        """True if the other end of the control pipe is closed."""
        return self._reader.ended

    def send(self, order: FromParent, fds: Sequence[int] = ()) -> None:
        """Send `order` with attached queue ends, unless the robot is gone.

        Raises `RobotsLostError` if the robot does not read for `_UNRESPONSIVE_S` seconds.
        """
        body = _ENCODER.encode(order)
        frame = len(body).to_bytes(4, "big") + body
        deadline = time.monotonic() + _UNRESPONSIVE_S
        while frame:
            try:
                sent = socket.send_fds(self.control, [frame], fds)
            except (BrokenPipeError, ConnectionResetError):
                return
            except OSError as error:
                # The pipe is full, or too many descriptors are in transit for the kernel: the robot must read first.
                if error.errno not in {errno.EAGAIN, errno.ETOOMANYREFS}:
                    raise
                if time.monotonic() > deadline:
                    raise RobotsLostError({self.name: "it does not answer"}) from error
                ended_of([self.process.sentinel], 0.001)
                continue
            frame, fds = frame[sent:], ()

    @property
    def status(self) -> ProcessStatus:
        """The state of the process."""
        return process_status(self.process.pid)

    @property
    def is_computing(self) -> bool:
        """True if the process uses the processor, or waits for it."""
        return is_computing(self.process.pid)

    def describe_end(self) -> str:
        """Return a description of the end of the process."""
        return describe_end(self.process)
