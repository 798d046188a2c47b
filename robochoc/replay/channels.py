"""What was said in a recorded run, as it is to be handed on: the messages of each channel, in their order.

The n-th message that was received on a channel is the n-th that was sent on it. A journal does not keep messages as
they travelled, but their fields. In its binary form these are as they were, and a message is made again from them; in
its text form numbers that are not finite, bytes, and keys that are no text, have become something else, and it is made
again by its type. What a type would make of fields that are as they were is not used: where it says `float` a protocol
may have said 0, which travels as the integer that it is.
Whether that has worked shows in its size, which the journal knows. Where it has not, the one is used that the sender
has said again.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any, get_args

import msgspec

from robochoc.journal.events import AnyEvent, Received, Sent
from robochoc.model.message import Envelope, Message
from robochoc.protocols.protocol import Protocol

Edge = tuple[str, str]

_UNFIT = (msgspec.MsgspecError, RecursionError, UnicodeError, TypeError, OverflowError)
"""What is raised for fields that are no message's: a journal's may be anything."""

_encode = msgspec.msgpack.Encoder().encode


class MessageDecoder:
    """The messages of one protocol, made again from their recorded fields."""

    def __init__(self, protocol: type[Protocol]) -> None:
        union = protocol.messages
        kinds: Iterable[type[Message]] = get_args(union) or (union,)
        self._tags = {kind.__name__: kind.__struct_config__.tag for kind in kinds}
        self._union = union
        self._decoder: msgspec.msgpack.Decoder[Message] = msgspec.msgpack.Decoder(union)

    def message(self, content: bytes) -> Message:
        """The message that has this `content`."""
        return self._decoder.decode(content)

    def content(self, sent: Sent) -> bytes | None:
        """The content of the message as it travelled; None where what was recorded does not tell it."""
        if sent.type not in self._tags:
            return None
        fields = [self._tags[sent.type], *sent.content.values()]
        for read in (self._as_it_was, self._through_type, self._through_json):
            try:
                content = read(fields)
            except _UNFIT:
                continue
            if len(content) == sent.bytes:
                return content
        return None

    def same(self, recorded: Sent, replayed: Sent) -> bool:
        """Whether a message has the fields that were `recorded`, through whichever form of journal these have been."""
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

    def _as_it_was(self, fields: list[Any]) -> bytes:
        content = _encode(fields)
        self._decoder.decode(content)  # so that it is a message of the protocol's
        return content

    def _through_type(self, fields: list[Any]) -> bytes:
        return _encode(self._decoder.decode(_encode(fields)))

    def _through_json(self, fields: list[Any]) -> bytes:
        """JSON makes text of bytes, and of keys that are none."""
        return _encode(msgspec.convert(fields, self._union, str_keys=True))


class RecordedChannels:
    """The messages of one run, or epoch, by channel.

    `events` are the run's. What robots say again is put in, and handed on rather than what was recorded.
    """

    def __init__(self, events: Iterable[AnyEvent], words: MessageDecoder) -> None:
        self._words = words
        self._recorded: dict[Edge, deque[Sent]] = {}
        self._again: dict[Edge, deque[bytes]] = {}
        self._ahead: dict[Edge, int] = {}
        """How many messages of a channel were handed on before they were said again."""
        for event in events:
            if isinstance(event, Sent):
                self._recorded.setdefault((event.sender, event.receiver), deque()).append(event)

    def say(self, envelope: Envelope) -> None:
        """A robot has said this again."""
        edge = (envelope.sender, envelope.receiver)
        if self._ahead.get(edge, 0):
            self._ahead[edge] -= 1
        else:
            self._again.setdefault(edge, deque()).append(envelope.content)

    def can_hand_on(self, packet: Sequence[Received]) -> bool:
        """Whether all of `packet` can be made, or never will be, so that there is nothing to wait for."""
        wanted = Counter((received.sender, received.receiver) for received in packet)
        for edge, count in wanted.items():
            here = len(self._again.get(edge, ()))
            if here < count:
                recorded = islice(self._recorded.get(edge, ()), here, count)
                if any(self._words.content(sent) is None for sent in recorded):
                    return False
        return True

    def hand_on(self, received: Received) -> tuple[Sent | None, Envelope | None]:
        """What was received: as it was recorded, None where that is lost; and made again, None where it cannot be."""
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
            content = self._words.content(sent)
        return sent, None if content is None else Envelope(*edge, content, sent.clock)
