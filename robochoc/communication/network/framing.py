"""Letters: what goes around each word, so that nothing is taken twice, out of place, or from another run.

Pure. The router proves who has sent a letter (`access.py`); its run and its number say which one it is. Within a run
the letters of an ordered pair are numbered from 1, and come in that order or not at all. Words before a run
(from `Register` to `Joined`, requests of observers) carry no run and no number: repeating them changes nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import msgspec

from robochoc.communication.network.control_messages import (
    Ask,
    Denied,
    Joined,
    Register,
    Sniff,
    Sniffable,
    Told,
    ToMaster,
    ToPeer,
    ToRobot,
    Welcome,
    Word,
)
from robochoc.solver.encoding import UnsupportedError

MASTER = "MASTER"
"""The master's name, as in Figure 3. No robot can have it."""
LARGEST_LETTER = 8 * 2**20
"""Bytes. zenoh drops what is larger than it was told to take without a word, so it is said here, before."""

_OUTSIDE = Register | Welcome | Denied | Joined | Ask | Told | Sniff | Sniffable


class MessageTooLargeError(UnsupportedError):
    """A word needs more bytes than a letter may have."""


class FrameRefusedError(ValueError):
    """A letter that is not accepted; the message says why."""


class Letter(msgspec.Struct, frozen=True, array_like=True):
    """`word` on its way in the run `run`, as letter `number` from its sender to its receiver."""

    run: str
    number: int
    word: Word


class _ToMaster(Letter, frozen=True, array_like=True):
    word: ToMaster


class _ToRobot(Letter, frozen=True, array_like=True):
    word: ToRobot


class _ToPeer(Letter, frozen=True, array_like=True):
    word: ToPeer


class Opened(NamedTuple):
    """A letter that can be accepted: its number (0: it has none), and the word in it."""

    number: int
    word: Word


class Framing:
    """The letters that `name` writes and reads; `run` is empty until there is one."""

    def __init__(self, name: str, run: str = "") -> None:
        self.name = name
        self.run = run
        self._written: dict[str, int] = {}
        self._read: dict[str, int] = {}
        self._encode = msgspec.msgpack.Encoder().encode
        self._of_master = msgspec.msgpack.Decoder(_ToRobot)
        self._of_robot = msgspec.msgpack.Decoder(_ToMaster if name == MASTER else _ToPeer)

    def begin(self, run: str) -> None:
        """A run begins: numbers start anew."""
        self.run = run
        self._written.clear()
        self._read.clear()

    def forget(self, other: str) -> None:
        """What comes from `other`, and goes there, is numbered anew: it is another life of that robot."""
        self._written.pop(other, None)
        self._read.pop(other, None)

    def next_number(self, receiver: str) -> int:
        """The number of the next letter to `receiver`."""
        return self._written.get(receiver, 0) + 1

    def write(self, receiver: str, word: Word) -> bytes:
        """The next letter to `receiver`. Raises `MessageTooLargeError`."""
        outside = isinstance(word, _OUTSIDE)
        letter = Letter("", 0, word) if outside else Letter(self.run, self.next_number(receiver), word)
        content = self._encode(letter)
        if len(content) > LARGEST_LETTER:
            raise MessageTooLargeError(
                f"a message of {self.name} to {receiver} has {len(content):,} bytes, more than {LARGEST_LETTER:,}"
            )
        if not outside:
            self._written[receiver] = letter.number
        return content

    def read(self, sender: str, content: bytes) -> Opened:
        """What `sender` has written; it may come again until it has been `taken`. Raises `FrameRefusedError`."""
        if len(content) > LARGEST_LETTER:
            raise FrameRefusedError(f"it has {len(content):,} bytes, more than {LARGEST_LETTER:,}")
        decoder = self._of_master if sender == MASTER else self._of_robot
        try:
            letter = decoder.decode(content)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
            raise FrameRefusedError(f"it is malformed: {error}") from None
        if isinstance(letter.word, _OUTSIDE):
            return Opened(0, letter.word)
        if not self.run or letter.run != self.run:
            raise FrameRefusedError("it is a replay: it was written in another run")
        expected = self._read.get(sender, 0) + 1
        if letter.number < expected:
            raise FrameRefusedError(f"it is a replay: letter {letter.number} has come before")
        if letter.number > expected:
            raise FrameRefusedError(f"letter {expected} is missing before letter {letter.number}")
        return Opened(letter.number, letter.word)

    def take(self, sender: str, number: int) -> None:
        """The letter `number` of `sender` is what it claims to be: from now on the next one is expected."""
        if number:
            self._read[sender] = max(number, self._read.get(sender, 0))
