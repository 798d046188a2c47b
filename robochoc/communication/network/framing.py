"""Frames around messages, which ensure that no message is accepted twice, out of order, or from another run. Pure.

The router verifies the sender of a frame (`access.py`); the run and the number identify the frame. Within a run the
frames from one participant to another are numbered from 1, and arrive in that order or not at all. Messages before a
run (from `Register` to `Joined`, and requests by observers) have no run and no number: repeating them has no effect.
"""

from __future__ import annotations

from typing import NamedTuple

import msgspec

from robochoc.communication.network.control_messages import (
    ControlMessage,
    DirectoryAnswer,
    DirectoryRequest,
    Joined,
    JournalAnswer,
    JournalRequest,
    Register,
    RegistrationDenied,
    StandbyAnswer,
    StandbyRequest,
    ToMaster,
    ToPeer,
    ToRobot,
    Welcome,
)
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import RobochocError

MASTER = "MASTER"
"""The master's name, as in Figure 3. No robot may have this name."""
LARGEST_FRAME = 8 * 2**20
"""In bytes. zenoh drops larger content without an error, so larger frames are refused with an error message."""

_OUTSIDE = (
    Register
    | Welcome
    | RegistrationDenied
    | Joined
    | DirectoryRequest
    | DirectoryAnswer
    | JournalRequest
    | JournalAnswer
    | StandbyRequest
    | StandbyAnswer
)


class MessageTooLargeError(UnsupportedError):
    """Raised if a message needs more bytes than a frame may have."""


class FrameRefusedError(RobochocError, ValueError):
    """Raised if a frame is not accepted. The text is the reason."""


class Frame(msgspec.Struct, frozen=True, array_like=True):
    """Contains `message` in the run `run`, as frame `number` from its sender to its receiver."""

    run: str
    number: int
    message: ControlMessage


class _ToMaster(Frame, frozen=True, array_like=True):
    message: ToMaster


class _ToRobot(Frame, frozen=True, array_like=True):
    message: ToRobot


class _ToPeer(Frame, frozen=True, array_like=True):
    message: ToPeer


class Opened(NamedTuple):
    """The content of a valid frame: its number (0: it has no number) and its message."""

    number: int
    message: ControlMessage


class Framing:
    """Writes and reads the frames of `name`. `run` is empty before the start of a run."""

    def __init__(self, name: str, run: str = "") -> None:
        self.name = name
        self.run = run
        self._written: dict[str, int] = {}
        self._read: dict[str, int] = {}
        self._encode = msgspec.msgpack.Encoder().encode
        self._of_master = msgspec.msgpack.Decoder(_ToRobot)
        self._of_robot = msgspec.msgpack.Decoder(_ToMaster if name == MASTER else _ToPeer)

    def start_run(self, run: str) -> None:
        """Start a run. Frames are numbered from 1."""
        self.run = run
        self._written.clear()
        self._read.clear()

    def forget(self, other: str) -> None:
        """Restart the numbering of frames from and to `other` at 1, because that robot was restarted."""
        self._written.pop(other, None)
        self._read.pop(other, None)

    def next_number(self, receiver: str) -> int:
        """Return the number of the next frame to `receiver`."""
        return self._written.get(receiver, 0) + 1

    def write(self, receiver: str, message: ControlMessage) -> bytes:
        """Return the next frame to `receiver`. Raises `MessageTooLargeError`."""
        outside = isinstance(message, _OUTSIDE)
        frame = Frame("", 0, message) if outside else Frame(self.run, self.next_number(receiver), message)
        content = self._encode(frame)
        if len(content) > LARGEST_FRAME:
            raise MessageTooLargeError(
                f"a message of {self.name} to {receiver} has {len(content):,} bytes, more than {LARGEST_FRAME:,}"
            )
        if not outside:
            self._written[receiver] = frame.number
        return content

    def read(self, sender: str, content: bytes) -> Opened:
        """Return the message in a frame from `sender`. The same frame may arrive again until `accept` is called.

        Raises `FrameRefusedError`.
        """
        if len(content) > LARGEST_FRAME:
            raise FrameRefusedError(f"it has {len(content):,} bytes, more than {LARGEST_FRAME:,}")
        decoder = self._of_master if sender == MASTER else self._of_robot
        try:
            frame = decoder.decode(content)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
            raise FrameRefusedError(f"it is malformed: {error}") from None
        if isinstance(frame.message, _OUTSIDE):
            return Opened(0, frame.message)
        if not self.run or frame.run != self.run:
            raise FrameRefusedError("it is a replay: it was written in another run")
        expected = self._read.get(sender, 0) + 1
        if frame.number < expected:
            raise FrameRefusedError(f"it is a replay: frame {frame.number} has already arrived")
        if frame.number > expected:
            raise FrameRefusedError(f"frame {expected} is missing before frame {frame.number}")
        return Opened(frame.number, frame.message)

    def accept(self, sender: str, number: int) -> None:
        """Accept the frame `number` from `sender`, and expect the next number."""
        if number:
            self._read[sender] = max(number, self._read.get(sender, 0))
