"""The parent's side of one robot: its process, the control pipe to it, and how the process ended."""

from __future__ import annotations

import errno
import itertools
import multiprocessing.connection
import re
import signal
import socket
import time
from collections.abc import Mapping, Sequence
from enum import Enum, auto
from multiprocessing.process import BaseProcess
from pathlib import Path

import msgspec

from robochoc.communication.control import FromParent, FromRobot, Report
from robochoc.communication.processes.queues import QueueReader

_TOLD = 5
_DEAF_S = 10.0
_EXIT_CODE_S = 1.0
_EXIT_CODE_POLL_S = 0.001
_AWAITS = re.compile(r"^SigPnd:\s*([0-9a-f]+)$", re.MULTILINE)
_STOPPED = re.compile(r"^State:\s*T\b", re.MULTILINE)
"""Stopped by a signal; a debugger's `t` is another state."""
_SIGKILL_BIT = 1 << (signal.SIGKILL - 1)


class Condition(Enum):
    """What the kernel says of a process."""

    LIVES = auto()
    STOPPED = auto()
    DIES = auto()


class RobotsLostError(Exception):
    """Robots whose processes ended, or failed, before the run did: `robots` says why, by name."""

    def __init__(self, robots: Mapping[str, str]) -> None:
        words = [f"{name} was lost: {why}" for name, why in itertools.islice(robots.items(), _TOLD)]
        if len(robots) > _TOLD:
            words.append(f"and {len(robots) - _TOLD} others were lost")
        super().__init__("; ".join(words))
        self.robots = dict(robots)


class RobotLink:
    """The parent's side of one robot: its process, its control pipe, and what it reported."""

    def __init__(self, name: str, process: BaseProcess, control: socket.socket) -> None:
        self.name = name
        self.process = process
        self.control = control
        self.report: Report | None = None
        self.ended = False
        """Whether its process is known to have ended."""
        self._reader = QueueReader(control.fileno())
        self._decoder = msgspec.msgpack.Decoder(FromRobot)
        self._encoder = msgspec.msgpack.Encoder()

    def words(self) -> list[FromRobot]:
        """What comes over the control pipe. `hung_up` tells afterwards whether its other end is closed."""
        return [self._decoder.decode(body) for body in self._reader.get()]

    def last_words(self) -> list[FromRobot]:
        """All that is left in the control pipe of a process that has ended."""
        return [self._decoder.decode(body) for body in self._reader.get_all()]

    @property
    def hung_up(self) -> bool:
        """Whether the other end of the control pipe is closed."""
        return self._reader.ended

    def tell(self, order: FromParent, fds: Sequence[int] = ()) -> None:
        """Send `order`, with the ends of queues if any are given. To a robot that is gone: nothing.

        Raises `RobotsLostError` when the robot does not read for `_DEAF_S` seconds.
        """
        body = self._encoder.encode(order)
        frame = len(body).to_bytes(4, "big") + body
        deadline = time.monotonic() + _DEAF_S
        while frame:
            try:
                sent = socket.send_fds(self.control, [frame], fds)
            except (BrokenPipeError, ConnectionResetError):
                return
            except OSError as error:
                # Full, or the kernel holds as many descriptors under way as it allows: the robot has to read first.
                if error.errno not in {errno.EAGAIN, errno.ETOOMANYREFS}:
                    raise
                if time.monotonic() > deadline:
                    raise RobotsLostError({self.name: "it does not answer"}) from error
                multiprocessing.connection.wait([self.process.sentinel], 0.001)
                continue
            frame, fds = frame[sent:], ()

    def condition(self) -> Condition:
        """Whether the process lives, is stopped, or ends with its next turn (Linux; elsewhere it lives).

        It ends when SIGKILL awaits it, or it has no memory any more. One that gives way to others (`nice`) gets that
        turn late on a busy machine, up to seconds after it was killed.
        """
        try:
            status = Path(f"/proc/{self.process.pid}/status").read_text()
        except OSError:
            return Condition.LIVES
        awaits = _AWAITS.search(status)
        if "VmSize:" not in status or (awaits is not None and bool(int(awaits[1], 16) & _SIGKILL_BIT)):
            return Condition.DIES
        return Condition.STOPPED if _STOPPED.search(status) else Condition.LIVES

    @property
    def is_computing(self) -> bool:
        """Whether the process has a turn of the processor, or would take one (Linux)."""
        try:
            status = Path(f"/proc/{self.process.pid}/stat").read_text()
        except OSError:
            return False
        return status.rpartition(")")[2].split()[0] == "R"

    def fate(self) -> str:
        """How the process ended, in words."""
        return fate_of(self.process)


def fate_of(process: BaseProcess) -> str:
    """How `process` ended, in words. Its sentinel has told; the exit code comes a moment later."""
    deadline = time.monotonic() + _EXIT_CODE_S
    # Not `join`, whose time limit ends with the sentinel: a process can close all its files and live on.
    while (code := process.exitcode) is None:
        if time.monotonic() > deadline:
            return "its process cannot be reached any more"
        time.sleep(_EXIT_CODE_POLL_S)
    if code < 0:
        return f"its process was killed by {_name_of(-code)}"
    return f"its process ended with status {code}"


def _name_of(signum: int) -> str:
    """Of most signals: SIGKILL. Those in the real-time range have none."""
    try:
        return signal.Signals(signum).name
    except ValueError:
        return f"signal {signum}"
