"""Converts the messages of a run to FIPA ACL: each envelope becomes an ACL message with all its content.

The content is JSON: an array of the message's type and its fields by name, such as `["Ok",{"value":[3]}]`. A value
without a JSON form becomes an object with one member: `{"base64":"..."}` for bytes, `{"float":"inf"}` for a number, or
`{"map":[...]}` for pairs of key and value. If JSON cannot represent the content exactly, or only with more than
`MAX_JSON` characters, it is sent as msgpack in base64. `:language` and `:encoding` state the form.

`Conversation` converts envelopes, using their protocol. `AclMessages` converts the messages in a journal; if the
protocol is missing or has another version, it uses the recorded fields.
"""

from __future__ import annotations

import math
import re
from base64 import b64decode, b64encode
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, get_args

import msgspec

from robochoc.protocols.message import Envelope, Message, encode
from robochoc.protocols.protocol import Protocol
from robochoc.services.identifier import AgentIdentifier, identifier_on
from robochoc.sniffer.acl import ACLError, ACLMessage
from robochoc.sniffer.recorded_messages import RunProtocols
from robochoc.sniffer.trace import Trace

ONTOLOGY = "robochoc"
JSON = ("json", "utf-8")
PACKED = ("msgpack", "base64")
"""The language and the encoding of contents that are not JSON."""
CLOCK = "x-clock"
"""The user-defined parameter with the sender's NCCC clock."""
MAX_JSON = 1 << 22
"""The maximum number of characters. Small lists need many times the memory of their text."""

_DEPTH = 32
_NUMBER = re.compile(r"[0-9]{1,18}")
_NOT_FINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}


class _InexpressibleError(Exception):
    """A value has no JSON form."""


class Conversation:
    """One run of the protocol `name` between robots on `platform` (`host:port/robochoc`).

    Raises:
        ValueError: if `platform` does not have this form.
    """

    def __init__(self, protocol: type[Protocol], name: str, platform: str, conversation_id: str) -> None:
        identifier_on(platform, name)
        self._protocol = name
        self._platform = platform
        self._id = conversation_id
        self._decoder = msgspec.msgpack.Decoder(protocol.messages)
        self._fields = _fields_of(protocol)

    def acl_of(self, envelope: Envelope, sequence: int, reply_to: int | None = None) -> ACLMessage:
        """Return the ACL message for `envelope`. `sequence` is the sender's number for this message.

        If `reply_to` is given, it is a reply to the receiver's message with this number.

        Raises:
            ACLError: if the content is not a message of the protocol.
        """
        message = self._decoded(envelope.content)
        said = _json_of(envelope.content, self._fields)
        language, encoding = PACKED if said is None else JSON
        return ACLMessage(
            performative=message.act.performative,
            sender=identifier_on(self._platform, envelope.sender),
            receiver=(identifier_on(self._platform, envelope.receiver),),
            content=b64encode(envelope.content).decode() if said is None else said,
            language=language,
            encoding=encoding,
            ontology=ONTOLOGY,
            protocol=self._protocol,
            conversation_id=self._id,
            reply_with=f"{envelope.sender}/{sequence}",
            in_reply_to=None if reply_to is None else f"{envelope.receiver}/{reply_to}",
            user=((CLOCK, str(envelope.clock)),),
        )

    def envelope_of(self, acl: ACLMessage) -> tuple[Envelope, Message]:
        """Return the envelope and the message in `acl`, checked by the protocol's own decoder.

        Raises:
            ACLError: if the message does not belong to this conversation, or is not a message of the protocol.
        """
        for what, found, expected in (
            ("ontology", acl.ontology, ONTOLOGY),
            ("protocol", acl.protocol, self._protocol),
            ("conversation-id", acl.conversation_id, self._id),
        ):
            if found != expected:
                raise ACLError(f"{what} is {_shown(found)}; it must be {expected!r}")
        clock = dict(acl.user).get(CLOCK, "")
        if not _NUMBER.fullmatch(clock):
            raise ACLError(f"{CLOCK} is {_shown(clock)}; it must be a number of constraint checks")
        content = self._content(acl)
        message = self._decoded(content)
        performative = message.act.performative
        if acl.performative is not performative:
            kind = type(message).__name__
            raise ACLError(f"the performative is {acl.performative}; that of {kind} is {performative}")
        if acl.sender is None or len(acl.receiver) != 1:
            raise ACLError("the message must have one sender and one receiver")
        return Envelope(self._local(acl.sender), self._local(acl.receiver[0]), content, int(clock)), message

    def _decoded(self, content: bytes) -> Message:
        try:
            message: Message = self._decoder.decode(content)
        except (msgspec.MsgspecError, RecursionError) as error:
            raise ACLError(f"the content is not a message of {self._protocol}: {error}") from None
        return message

    def _content(self, acl: ACLMessage) -> bytes:
        said = acl.content or ""
        form = acl.language, acl.encoding
        if form == JSON:
            return _content_of(said, self._fields)
        if form != PACKED:
            forms = " or ".join(" in ".join(known) for known in (JSON, PACKED))
            raise ACLError(f"language and encoding are {_shown(form)}; they must be {forms}")
        try:
            return b64decode(said, validate=True)
        except ValueError as error:
            raise ACLError(f"the content is not valid base64: {error}") from None

    def _local(self, agent: AgentIdentifier) -> str:
        if agent.platform != self._platform:
            raise ACLError(f"{_shown(agent.name)} is not on the platform {self._platform!r}")
        return agent.local


def _fields_of(protocol: type[Protocol]) -> dict[str, tuple[str, ...]]:
    """Return the field names of each message type that is encoded as an array, by tag."""
    return {
        kind.__struct_config__.tag: tuple(field.name for field in msgspec.structs.fields(kind))
        for kind in get_args(protocol.messages) or (protocol.messages,)
        if kind.__struct_config__.array_like
    }


def _json_of(content: bytes, fields: Mapping[str, Sequence[str]]) -> str | None:
    """Return `content` as JSON, or None if the JSON would lose information or be too long."""
    try:
        kind, *values = msgspec.msgpack.decode(content)
        said = [kind, {name: _exact_json(value, 0) for name, value in zip(fields[kind], values, strict=True)}]
        text = msgspec.json.encode(said).decode()
        return text if len(text) <= MAX_JSON and _content_of(text, fields) == content else None
    except (_InexpressibleError, msgspec.MsgspecError, LookupError, ValueError, TypeError, RecursionError):
        return None


def _content_of(text: str, fields: Mapping[str, Sequence[str]]) -> bytes:
    """Return the msgpack bytes for a content in JSON. Raises `ACLError`."""
    if len(text) > MAX_JSON:
        raise ACLError(f"the content has {len(text):,} characters, more than {MAX_JSON:,} as JSON")
    try:
        kind, given = msgspec.json.decode(text, type=tuple[str, dict[str, Any]])
        return msgspec.msgpack.encode([kind, *(_from_json(given[name], 0) for name in _names(kind, given, fields))])
    except ACLError:
        raise
    except (msgspec.MsgspecError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise ACLError(f'the content is not JSON like ["Ok",{{"value":[3]}}]: {error}') from None


def _names(kind: str, given: Collection[str], fields: Mapping[str, Sequence[str]]) -> Sequence[str]:
    """Return the field names of `kind` in the right order. Raises `ACLError` if `given` contains other names."""
    if kind not in fields:
        raise ACLError(f"the message type {_shown(kind)} is unknown; known types: {', '.join(fields)}")
    names = fields[kind]
    if set(names) != set(given):
        raise ACLError(f"the fields of {kind} are {_shown(list(names))}, but this message has {_shown(sorted(given))}")
    return names


def _exact_json(value: object, depth: int) -> object:
    """Return a value decoded from msgpack in JSON form. Raises `_InexpressibleError`."""
    match value:
        case None | bool() | int() | str():
            return value
        case float():
            return value if math.isfinite(value) else {"float": str(value)}
        case bytes():
            return {"base64": b64encode(value).decode()}
        case list() | tuple() if depth < _DEPTH:
            return [_exact_json(one, depth + 1) for one in value]
        case dict() if depth < _DEPTH:
            members = {key: _exact_json(one, depth + 1) for key, one in value.items()}
            if all(isinstance(key, str) for key in members) and not _is_mark(members):
                return members
            return {"map": [[_exact_json(key, depth + 1), one] for key, one in members.items()]}
    raise _InexpressibleError


def _from_json(value: Any, depth: int) -> Any:  # noqa: ANN401 - any JSON
    """Return the value from which `_exact_json` made this JSON. Raises `ValueError` and others for invalid JSON."""
    if depth > _DEPTH:
        raise ValueError(f"the lists are nested deeper than {_DEPTH} levels")
    if isinstance(value, list):
        return [_from_json(one, depth + 1) for one in value]
    if not isinstance(value, dict):
        return value
    if not _is_mark(value):
        return {key: _from_json(one, depth + 1) for key, one in value.items()}
    ((mark, given),) = value.items()
    if mark == "base64" and isinstance(given, str):
        return b64decode(given, validate=True)
    if mark == "float" and given in _NOT_FINITE:
        return _NOT_FINITE[given]
    if mark == "map" and isinstance(given, list):
        return {_key(_from_json(key, depth + 1)): _from_json(one, depth + 1) for key, one in given}
    raise ValueError(f"invalid value for {mark}")


def _is_mark(members: Mapping[Any, object]) -> bool:
    return len(members) == 1 and next(iter(members)) in _MARKS


def _key(value: object) -> object:
    """Return a valid key for a msgpack map: a list becomes a tuple."""
    return tuple(map(_key, value)) if isinstance(value, list) else value


def _shown(found: object) -> str:
    """Return a short form of untrusted input for an error message."""
    shown = repr(found)
    return shown if len(shown) <= 80 else f"{shown[:80]}..."  # noqa: PLR2004 - a line's worth


_MARKS = {"base64", "float", "map"}
"""Keys of objects that represent values without a JSON form."""
PLATFORM = "localhost/robochoc"
"""The platform name used instead of the machine's name, which journals do not contain."""

_FIELDS = tuple(field.name for field in msgspec.structs.fields(ACLMessage) if field.name != "user")


class AclMessages:
    """The ACL messages of `trace`."""

    def __init__(self, trace: Trace, protocols: RunProtocols) -> None:
        self._trace = trace
        self._protocols = protocols
        self._conversations: dict[int, Conversation | None] = {}

    def acl_of(self, message: int) -> ACLMessage:
        """Return a message in FIPA ACL. It is a reply if its step received exactly one message from the receiver."""
        trace, of = self._trace, self._trace.messages
        answered = [cause for cause in trace.causes(message) if of.sender[cause] == of.receiver[message]]
        reply_to = of.sequence[answered[0]] if len(answered) == 1 else None
        envelope = self._envelope(message)
        if envelope is not None:
            conversation = self._conversation(self._trace.messages.run[message])
            if conversation is not None:
                try:
                    return conversation.acl_of(envelope, of.sequence[message], reply_to)
                except ValueError:  # an `ACLError`, or a name that is invalid for an agent
                    pass
        return self._from_fields(message, reply_to)

    def plain(self, message: int) -> dict[str, Any]:
        """Return the fields of a message in a form that JSON supports."""
        return {name: plain(value) for name, value in self._trace.content(message).items()}

    def fields(self, acl: ACLMessage) -> dict[str, str]:
        """Return the parameters of `acl` that are set as text, by their names in FIPA00070."""
        shown = {name.replace("_", "-"): _text(getattr(acl, name)) for name in _FIELDS}
        shown.update({f"X-{name[2:]}": value for name, value in acl.user})
        return {name: value for name, value in shown.items() if value}

    def _envelope(self, message: int) -> Envelope | None:
        """Return a message's envelope, or None if the protocol is not installed or lacks this message type."""
        trace, of = self._trace, self._trace.messages
        kind = self._protocols.type_of(message)
        if kind is None:
            return None
        size, content = of.bytes[message], None
        for packed in _packings(kind, trace.content(message)):
            if content is None or len(packed) == size:
                content = packed
            if len(content) == size:
                break
        if content is None:
            return None
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

    def _from_fields(self, message: int, reply_to: int | None) -> ACLMessage:
        """Return an ACL message made from the recorded fields, without the protocol."""
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
    """Return `value` in a JSON form that need not be convertible back."""
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
    """Yield possible msgpack bytes for a message: from the recorded fields, as they are and converted to their types.

    Journals in text form contain bytes in base64, and do not distinguish 1 from 1.0.
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
