"""Messages between robots, and their envelope.

A protocol defines its own messages as subclasses of `Message`, named as in its paper. They travel as msgpack (msgspec):
compact, and validated against their declared types when they are decoded. Foreign bytes can do no more than fail to
decode.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import msgspec

from robochoc.model.communicative_acts import INFORM, Act
from robochoc.model.wording import Wording

if TYPE_CHECKING:
    from robochoc.model.disclosure import Hearing, Proof

Value = tuple[int | None, ...]
"""A robot's value as others see it: the values of its interface variables, in the order of its file.

In the left side of a nogood, and in the value that it rules out, None stands for a variable that does not matter:
the nogood holds whatever that variable's value is, and so for every value of the robot that looks alike.
"""


class Message(msgspec.Struct, frozen=True, tag=True, array_like=True):
    """Base of all messages of all protocols; the class's name is its type on the wire.

    All that is special about a message stands in its class: its fields, its `act`, its words, what it proves. The
    sniffer, FIPA ACL, the exports and the measure of privacy ask the class.
    """

    act: ClassVar[Act] = INFORM
    """The communicative act of the message (FIPA)."""
    backtracks: ClassVar[bool] = False
    """True if the message is a backtrack: its sender has no value left."""
    shareable: ClassVar[bool] = False
    """True if its receivers change nothing in it: in the simulator all of them are given the same object."""

    proves_nothing: ClassVar[bool] = False
    """True if its receivers learn nothing of other robots' problems from the message: the rule of such a message."""

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - for those that have words
        """Return what the sender says: `V1.1 = 1 from now on`. Empty: the message is shown by its fields."""
        return ""

    def proves(self, hearing: Hearing) -> Sequence[Proof] | None:  # noqa: ARG002 - for those that have a rule
        """Return the proofs that the message gives its receiver about other robots (`model/disclosure.py`).

        None: there is no rule, and the receiver's knowledge is unknown. A message with `proves_nothing` needs no
        override.
        """
        return () if self.proves_nothing else None


class Envelope(NamedTuple):
    """One message in transit: sender, receiver, encoded content, and the sender's NCCC clock."""

    sender: str
    receiver: str
    content: bytes
    clock: int


_encoder = msgspec.msgpack.Encoder()


def encode(message: Message) -> bytes:
    """Return the content of `message` as it travels, and as it is counted in bytes."""
    return _encoder.encode(message)
