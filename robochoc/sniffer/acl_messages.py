"""The messages of a trace in FIPA ACL, as far as the recorded fields allow.

Where the protocol is installed they are those of `sniffer/conversation.py`; where it is not, or is another
than it was, they are made of what the journal holds.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

import msgspec

from robochoc.protocols.message import Envelope, Message, encode
from robochoc.services.identifier import AgentIdentifier, identifier_on
from robochoc.sniffer.acl import ACLMessage
from robochoc.sniffer.conversation import CLOCK, JSON, ONTOLOGY, Conversation
from robochoc.sniffer.recorded_messages import RunProtocols
from robochoc.sniffer.trace import Trace

_MARKS = {"base64", "float", "map"}
PLATFORM = "localhost/robochoc"
"""The name in place of the machine's, which journals do not record."""

_FIELDS = tuple(field.name for field in msgspec.structs.fields(ACLMessage) if field.name != "user")


class AclMessages:
    """The ACL messages of `trace`."""

    def __init__(self, trace: Trace, protocols: RunProtocols) -> None:
        self._trace = trace
        self._protocols = protocols
        self._conversations: dict[int, Conversation | None] = {}

    def acl_of(self, message: int) -> ACLMessage:
        """Return one message in FIPA ACL; it is a reply if its step received a single message of its receiver."""
        trace, of = self._trace, self._trace.messages
        answered = [cause for cause in trace.causes(message) if of.sender[cause] == of.receiver[message]]
        reply_to = of.sequence[answered[0]] if len(answered) == 1 else None
        envelope = self._envelope(message)
        if envelope is not None:
            conversation = self._conversation(self._trace.messages.run[message])
            if conversation is not None:
                try:
                    return conversation.acl_of(envelope, of.sequence[message], reply_to)
                except ValueError:  # BadACL is one; and so is a name that no agent has
                    pass
        return self._made_up(message, reply_to)

    def plain(self, message: int) -> dict[str, Any]:
        """Return the fields of a message in a form that JSON supports."""
        return {name: plain(value) for name, value in self._trace.content(message).items()}

    def fields(self, acl: ACLMessage) -> dict[str, str]:
        """Return the given parameters of `acl` as text, by their names in FIPA00070."""
        shown = {name.replace("_", "-"): _text(getattr(acl, name)) for name in _FIELDS}
        shown.update({f"X-{name[2:]}": value for name, value in acl.user})
        return {name: value for name, value in shown.items() if value}

    def _envelope(self, message: int) -> Envelope | None:
        """Return the message's envelope; None if its protocol is not installed, or has no such message."""
        trace, of = self._trace, self._trace.messages
        kind = self._protocols.type_of(message)
        if kind is None:
            return None
        size, said = of.bytes[message], list(_packings(kind, trace.content(message)))
        if not said:
            return None
        content = next((one for one in said if len(one) == size), said[0])
        sender, receiver = trace.robots[of.sender[message]], trace.robots[of.receiver[message]]
        return Envelope(sender, receiver, content, int(of.clock[message]))

    def _conversation(self, run: int) -> Conversation | None:
        if run not in self._conversations:
            found = self._protocols.of_run(run)
            as_arrays = all(kind.__struct_config__.array_like for kind in self._protocols.message_types(run).values())
            self._conversations[run] = (
                Conversation(found[1], found[0], PLATFORM, _conversation_id(run)) if found and as_arrays else None
            )
        return self._conversations[run]

    def _made_up(self, message: int, reply_to: int | None) -> ACLMessage:
        """Return the message, made without its protocol."""
        trace, of = self._trace, self._trace.messages
        sender, receiver = trace.robots[of.sender[message]], trace.robots[of.receiver[message]]
        kind, number = trace.kinds[of.kind[message]], of.run[message]
        found = self._protocols.of_run(number)
        return ACLMessage(
            performative=self._protocols.act_of(message).performative,
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


def plain(value: object, depth: int = 32) -> Any:  # noqa: ANN401 - any JSON
    """Return `value` in the JSON form of `sniffer/conversation.py`."""
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
    """Yield possible msgpack bytes of a message: of its fields as recorded, and converted to their types.

    JSON journals hold bytes in base64, and do not distinguish 1 from 1.0.
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
