"""The messages of a trace as messages of FIPA ACL, as far as can be said of them afterwards.

Where the protocol is installed they are those of `sniffer/conversation.py`; where it is not, or is another
than it was, they are made of what the journal holds.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, get_args

import msgspec

from robochoc.model.message import Envelope, Message, encode
from robochoc.protocols.protocol import Protocol
from robochoc.run.registry import UnknownProtocolError, protocol_by_class, protocol_by_name
from robochoc.services.identifier import AgentIdentifier, identifier_on
from robochoc.sniffer.acl import ACLMessage
from robochoc.sniffer.conversation import CLOCK, JSON, ONTOLOGY, Conversation
from robochoc.sniffer.performatives import act_of
from robochoc.sniffer.trace import Trace

_MARKS = {"base64", "float", "map"}
PLATFORM = "localhost/robochoc"
"""Journals do not tell which machine it was."""

_FIELDS = tuple(field.name for field in msgspec.structs.fields(ACLMessage) if field.name != "user")


class Speech:
    """The ACL messages of `trace`."""

    def __init__(self, trace: Trace) -> None:
        self._trace = trace
        self._protocols: dict[int, tuple[str, type[Protocol]] | None] = {}
        self._runs: dict[int, tuple[Conversation, Mapping[str, type[Message]]] | None] = {}

    def acl_of(self, message: int) -> ACLMessage:
        """One message. It answers another where the step that said it took in one message of the receiver's only."""
        trace, of = self._trace, self._trace.messages
        answered = [cause for cause in trace.causes(message) if of.sender[cause] == of.receiver[message]]
        reply_to = of.sequence[answered[0]] if len(answered) == 1 else None
        envelope = self._envelope(message)
        if envelope is not None:
            talk = self._talk(message)
            if talk is not None:
                try:
                    return talk[0].acl_of(envelope, of.sequence[message], reply_to)
                except ValueError:  # BadACL is one; and so is a name that no agent has
                    pass
        return self._made_up(message, reply_to)

    def is_ours(self, run: int) -> bool:
        """Whether the protocol of a run is one of robochoc's; also if it is not to be found, as an older one's."""
        found = self._spoken(run)
        return found is None or found[1].__module__.startswith("robochoc.")

    def _spoken(self, run: int) -> tuple[str, type[Protocol]] | None:
        if run not in self._protocols:
            self._protocols[run] = spoken_in(self._trace, run)
        return self._protocols[run]

    def plain(self, message: int) -> dict[str, Any]:
        """The fields of a message as JSON can hold them."""
        return {name: plain(value) for name, value in self._trace.content(message).items()}

    def fields(self, acl: ACLMessage) -> dict[str, str]:
        """The parameters of `acl` that are given, under their names in FIPA00070, as text."""
        shown = {name.replace("_", "-"): _text(getattr(acl, name)) for name in _FIELDS}
        shown.update({f"X-{name[2:]}": value for name, value in acl.user})
        return {name: value for name, value in shown.items() if value}

    def _envelope(self, message: int) -> Envelope | None:
        """The message as it travelled; None where its protocol is not there, or does not know it."""
        trace, of = self._trace, self._trace.messages
        talk = self._talk(message)
        kind = None if talk is None else talk[1].get(trace.kinds[of.kind[message]])
        if kind is None:
            return None
        size, said = of.bytes[message], list(_packings(kind, trace.content(message)))
        if not said:
            return None
        content = next((one for one in said if len(one) == size), said[0])
        sender, receiver = trace.robots[of.sender[message]], trace.robots[of.receiver[message]]
        return Envelope(sender, receiver, content, int(of.clock[message]))

    def _talk(self, message: int) -> tuple[Conversation, Mapping[str, type[Message]]] | None:
        number = self._trace.messages.run[message]
        if number not in self._runs:
            self._runs[number] = self._conversation(number)
        return self._runs[number]

    def _conversation(self, number: int) -> tuple[Conversation, Mapping[str, type[Message]]] | None:
        found = self._spoken(number)
        if found is None:
            return None
        name, protocol = found
        kinds = {kind.__name__: kind for kind in get_args(protocol.messages) or (protocol.messages,)}
        if not all(kind.__struct_config__.array_like for kind in kinds.values()):
            return None
        return Conversation(protocol, name, PLATFORM, _conversation_id(number)), kinds

    def _made_up(self, message: int, reply_to: int | None) -> ACLMessage:
        """The message without its protocol's help."""
        trace, of = self._trace, self._trace.messages
        sender, receiver = trace.robots[of.sender[message]], trace.robots[of.receiver[message]]
        kind, number = trace.kinds[of.kind[message]], of.run[message]
        found = self._spoken(number)
        return ACLMessage(
            performative=act_of(kind).performative,
            sender=_identifier(sender),
            receiver=(_identifier(receiver),),
            content=msgspec.json.encode([kind, self.plain(message)]).decode(),
            language=JSON[0],
            encoding=JSON[1],
            ontology=ONTOLOGY,
            protocol=found[0] if found else trace.runs[number].protocol,
            conversation_id=_conversation_id(number),
            reply_with=f"{sender}/{of.sequence[message]}",
            in_reply_to=None if reply_to is None else f"{receiver}/{reply_to}",
            user=((CLOCK, str(int(of.clock[message]))),),
        )


def spoken_in(trace: Trace, number: int) -> tuple[str, type[Protocol]] | None:
    """The protocol of a run, and its name, if it is installed: journals name runs' protocols by their classes."""
    called = trace.runs[number].protocol
    if called == trace.header.protocol:  # a journal of one run without a beginning
        with suppress(UnknownProtocolError):
            return called, protocol_by_name(called)
    return protocol_by_class(called, [trace.header.protocol])


def plain(value: object, depth: int = 32) -> Any:  # noqa: ANN401 - any JSON
    """`value` in the words of JSON that `sniffer/conversation.py` has for it."""
    match value:
        case None | bool() | int() | str():
            found: Any = value
        case float():
            found = value if math.isfinite(value) else {"float": str(value)}
        case bytes():
            found = {"base64": b64encode(value).decode()}
        case list() | tuple() if depth:
            found = [plain(one, depth - 1) for one in value]
        case dict() if depth:
            told = [(plain(key, depth - 1), plain(one, depth - 1)) for key, one in value.items()]
            named = all(isinstance(key, str) for key in value) and not (len(value) == 1 and _MARKS & value.keys())
            found = dict(told) if named else {"map": told}
        case _:
            found = str(value)[:1000]
    return found


def _packings(kind: type[Message], content: Mapping[str, Any]) -> Iterator[bytes]:
    """The bytes that a message of these fields may have been: as they stand, and as their types would have them.

    Journals that are JSON have bytes in base64, and tell no number 1 from 1.0.
    """
    try:
        said = [kind.__struct_config__.tag, *(content[name] for name in kind.__struct_fields__)]
    except KeyError:
        return
    with suppress(msgspec.MsgspecError, TypeError, ValueError, OverflowError, RecursionError):
        packed = msgspec.msgpack.encode(said)
        msgspec.msgpack.decode(packed, type=kind)
        yield packed
    with suppress(msgspec.MsgspecError, TypeError, ValueError, OverflowError, RecursionError):
        yield encode(msgspec.convert(said, kind, str_keys=True))


def _conversation_id(number: int) -> str:
    return f"run-{number + 1}"


def _identifier(name: str) -> AgentIdentifier:
    return identifier_on(PLATFORM, name or "nobody")


def _text(value: object) -> str:
    match value:
        case None | ():
            return ""
        case AgentIdentifier():
            return value.name
        case tuple():
            return " ".join(map(_text, value))
        case _:
            return str(value)
