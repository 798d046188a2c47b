"""Restores the messages of a recorded run, channel by channel, so that they can be delivered again.

The n-th message received on a channel is the n-th message sent on it. A journal contains the fields of messages instead
of their bytes. The binary form of a journal preserves the fields, and messages are encoded from them. The text form
changes infinite numbers, bytes, and keys that are not strings; in this case messages are first decoded by their types.
The type is not used for preserved fields, because in a `float` field a protocol may have sent 0, which is encoded as an
integer. The recorded size of the message shows whether the restoration was successful. Otherwise the message of the
replayed sender is used.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any, get_args

import msgspec

from robochoc.journal.events import AnyEvent, Received, Sent
from robochoc.protocols.message import Envelope, Message
from robochoc.protocols.protocol import Protocol

Edge = tuple[str, str]

_UNFIT = (msgspec.MsgspecError, RecursionError, UnicodeError, TypeError, OverflowError)
"""Raised for fields that do not match a message: the fields in a journal are untrusted."""

_encode = msgspec.msgpack.Encoder().encode


class MessageDecoder:
    """Rebuilds the messages of one protocol from their recorded fields."""

    def __init__(self, protocol: type[Protocol]) -> None:
        union = protocol.messages
        kinds: Iterable[type[Message]] = get_args(union) or (union,)
        self._tags = {kind.__name__: kind.__struct_config__.tag for kind in kinds}
        self._union = union
        self._decoder: msgspec.msgpack.Decoder[Message] = msgspec.msgpack.Decoder(union)

    def message(self, content: bytes) -> Message:
        """Return the message with this `content`."""
        return self._decoder.decode(content)

    def content(self, sent: Sent) -> bytes | None:
        """Return the original content of the message; None if the record does not suffice."""
        if sent.type not in self._tags:
            return None
        fields = [self._tags[sent.type], *sent.content.values()]
        for read in (self._unchanged, self._through_type, self._through_json):
            try:
                content = read(fields)
            except _UNFIT:
                continue
            if len(content) == sent.bytes:
                return content
        return None

    def same(self, recorded: Sent, replayed: Sent) -> bool:
        """Return whether a replayed message has the `recorded` fields, in the binary or the text form of a journal."""
        if recorded.type != replayed.type or list(recorded.content) != list(replayed.content):
            return False
        fields, again = list(recorded.content.values()), list(replayed.content.values())
        content = self.content(recorded)
        try:
            if content is not None:
                return content == _encode([self._tags[recorded.type], *again])
            return msgspec.json.encode(fields) == msgspec.json.encode(again)
        except _UNFIT:
            return False

    def _unchanged(self, fields: list[Any]) -> bytes:
        content = _encode(fields)
        self._decoder.decode(content)  # raises if the content is not a message of the protocol
        return content

    def _through_type(self, fields: list[Any]) -> bytes:
        return _encode(self._decoder.decode(_encode(fields)))

    def _through_json(self, fields: list[Any]) -> bytes:
        """Return the fields after conversion to JSON and back, which turns bytes and keys into text."""
        return _encode(msgspec.convert(fields, self._union, str_keys=True))


class RecordedChannels:
    """The messages in a run or an epoch with these `events`, by channel.

    If the replay has sent a message again, that message is delivered instead of the recorded one.
    """

    def __init__(self, events: Iterable[AnyEvent], decoder: MessageDecoder) -> None:
        self._decoder = decoder
        self._recorded: dict[Edge, deque[Sent]] = {}
        self._again: dict[Edge, deque[bytes]] = {}
        self._ahead: dict[Edge, int] = {}
        """For each channel, the number of messages that were delivered before they were sent again."""
        for event in events:
            if isinstance(event, Sent):
                self._recorded.setdefault((event.sender, event.receiver), deque()).append(event)

    def send_again(self, envelopes: Iterable[Envelope]) -> None:
        """Add messages that a robot has sent in the replay."""
        for envelope in envelopes:
            edge = (envelope.sender, envelope.receiver)
            if self._ahead.get(edge, 0):
                self._ahead[edge] -= 1
            else:
                self._again.setdefault(edge, deque()).append(envelope.content)

    def can_deliver(self, packet: Sequence[Received]) -> bool:
        """Return False if a message of `packet` may become available later."""
        wanted = Counter((received.sender, received.receiver) for received in packet)
        for edge, count in wanted.items():
            here = len(self._again.get(edge, ()))
            if here < count:
                recorded = islice(self._recorded.get(edge, ()), here, count)
                if any(self._decoder.content(sent) is None for sent in recorded):
                    return False
        return True

    def deliver(self, received: Received) -> tuple[Sent | None, Envelope | None]:
        """Return the record of a received message, and its envelope for the replay; None for what is missing."""
        edge = (received.sender, received.receiver)
        recorded = self._recorded.get(edge)
        if not recorded:
            return None, None
        sent = recorded.popleft()
        again = self._again.get(edge)
        if again:
            content: bytes | None = again.popleft()
        else:
            self._ahead[edge] = self._ahead.get(edge, 0) + 1
            content = self._decoder.content(sent)
        return sent, None if content is None else Envelope(*edge, content, sent.clock)
