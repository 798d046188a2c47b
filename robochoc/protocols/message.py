"""Messages between robots, and their envelope.

A protocol defines its own messages as subclasses of `Message`, named as in its paper. Messages are sent as msgpack
(msgspec), which is compact, and are validated against their declared types when they are decoded. So the worst that
bytes from an unknown source can cause is a decoding error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import msgspec

from robochoc.model.problem import Value
from robochoc.protocols.acts import INFORM, Act
from robochoc.protocols.wording import Wording

if TYPE_CHECKING:
    from robochoc.protocols.disclosure import Proof, Reception

__all__ = ["Envelope", "Message", "Value", "encode"]  # `Value` is exported for the authors of protocols


class Message(msgspec.Struct, frozen=True, tag=True, array_like=True):
    """The base class of the messages of all protocols; the class's name is its type on the wire.

    A class declares everything that is specific to its messages: fields, `act`, sentence, proofs. The sniffer, FIPA
    ACL, the exports and the privacy measure use these declarations.
    """

    act: ClassVar[Act] = INFORM
    """The communicative act of the message (FIPA)."""
    backtracks: ClassVar[bool] = False
    """True if the message is a backtrack: its sender has no value left."""
    shareable: ClassVar[bool] = False
    """True if its receivers do not modify the message: the simulator then passes the same object to all of them."""

    proves_nothing: ClassVar[bool] = False
    """True if its receivers learn nothing about other robots' problems from the message."""

    masked: ClassVar[frozenset[str]] = frozenset()
    """The fields that look the same to every minority of the robots, whatever the secrets of the other robots are."""

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - for overrides
        """Return the message as a sentence spoken by the sender: `V1.1 = 1 from now on`.

        If the sentence is empty, the fields of the message are shown instead.
        """
        return ""

    def proves(self, reception: Reception) -> Sequence[Proof] | None:  # noqa: ARG002 - for overrides
        """Return what the message proves to its receiver about other robots (`protocols/disclosure.py`).

        None means that there is no rule, so the receiver's knowledge is unknown. A message with `proves_nothing` needs
        no override.
        """
        return () if self.proves_nothing else None


class Envelope(msgspec.Struct, frozen=True, gc=False):
    """A message in transit: its sender, its receiver, its encoded content, and the sender's NCCC clock.

    Envelopes refer to no containers, so that Python's collector of cycles need not visit them.
    """

    sender: str
    receiver: str
    content: bytes
    clock: int


_encoder = msgspec.msgpack.Encoder()


def encode(message: Message) -> bytes:
    """Return the content of `message` as it is sent. The metric `bytes` counts the bytes of this content."""
    return _encoder.encode(message)
