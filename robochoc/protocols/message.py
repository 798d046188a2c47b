"""Messages between robots, and their envelope.

A protocol defines its own messages as subclasses of `Message`, named as in its paper. They travel as msgpack (msgspec):
compact, and validated against their declared types when they are decoded. Foreign bytes can only fail to decode.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import msgspec

from robochoc.model.problem import Value
from robochoc.protocols.acts import INFORM, Act
from robochoc.protocols.wording import Wording

if TYPE_CHECKING:
    from robochoc.protocols.disclosure import Proof, Reception

__all__ = ["Envelope", "Message", "Value", "encode"]  # `Value`: for the authors of protocols


class Message(msgspec.Struct, frozen=True, tag=True, array_like=True):
    """Base of all messages of all protocols; the class's name is its type on the wire.

    A class declares all that is special about its messages: fields, `act`, sentence, proofs. The sniffer, FIPA ACL, the
    exports and the measure of privacy use these declarations.
    """

    act: ClassVar[Act] = INFORM
    """The communicative act of the message (FIPA)."""
    backtracks: ClassVar[bool] = False
    """True if the message is a backtrack: its sender has no value left."""
    shareable: ClassVar[bool] = False
    """True if its receivers change nothing in it: the simulator then passes the same object to all of them."""

    proves_nothing: ClassVar[bool] = False
    """True if its receivers learn nothing about other robots' problems from the message."""

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - for overrides
        """Return the message as the sender's sentence: `V1.1 = 1 from now on`. Empty: its fields are shown."""
        return ""

    def proves(self, reception: Reception) -> Sequence[Proof] | None:  # noqa: ARG002 - for overrides
        """Return the proofs that the message gives its receiver about other robots (`protocols/disclosure.py`).

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
