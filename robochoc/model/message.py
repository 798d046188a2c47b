"""What robots say to each other, and how it is wrapped for the way.

A protocol defines its own messages as subclasses of :class:`Message`, named as in its paper. They travel as
msgpack (msgspec): compact, and validated against their declared types when they are decoded, so bytes from
elsewhere can do no more than fail to decode.
"""

from __future__ import annotations

from typing import NamedTuple

import msgspec

Value = tuple[int | None, ...]
"""A robot's value as others see it: the values of its interface variables, in the order of its file.

In the left side of a nogood, and in the value that it rules out, None stands for a variable that does not matter:
the nogood holds whatever that variable's value is, and so for every value of the robot that looks alike.
"""


class Message(msgspec.Struct, frozen=True, tag=True, array_like=True):
    """Base of all messages of all protocols; the class's name is its type on the wire."""


class Envelope(NamedTuple):
    """One message on its way: who, to whom, its encoded content, and the sender's NCCC clock."""

    sender: str
    receiver: str
    content: bytes
    clock: int


_encoder = msgspec.msgpack.Encoder()


def encode(message: Message) -> bytes:
    """The content of `message` as it travels, and as it is counted in bytes."""
    return _encoder.encode(message)
