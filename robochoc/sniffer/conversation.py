"""A run as a conversation of FIPA agents: each envelope has an ACL message with all its content.

The content is JSON, an array of the message's type and its fields by name: `["Ok",{"value":[3]}]`. What JSON has no
words for stands in an object of one member: `{"base64":"..."}` are bytes, `{"float":"inf"}` is a number, and
`{"map":[...]}` has pairs of key and value. A content that JSON cannot hold exactly, or not within `MAX_JSON`, travels
as the msgpack that it is, in base64; `:language` and `:encoding` tell which.
"""

from __future__ import annotations

import math
import re
from base64 import b64decode, b64encode
from collections.abc import Collection, Mapping, Sequence
from typing import Any, get_args

import msgspec

from robochoc.protocols.message import Envelope, Message
from robochoc.protocols.protocol import Protocol
from robochoc.services.identifier import AgentIdentifier, identifier_on
from robochoc.sniffer.acl import ACLError, ACLMessage

ONTOLOGY = "robochoc"
JSON = ("json", "utf-8")
PACKED = ("msgpack", "base64")
"""Language and encoding."""
CLOCK = "x-clock"
"""The user-defined parameter that holds the sender's NCCC clock."""
MAX_JSON = 1 << 22
"""Characters. Small lists in it take many times as much memory."""

_DEPTH = 32
_NUMBER = re.compile(r"[0-9]{1,18}")
_NOT_FINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}
_MARKS = {"base64", "float", "map"}


class _InexpressibleError(Exception):
    """A value that has no JSON form."""


class Conversation:
    """One run of the protocol `name`, among robots of `platform` (`host:port/robochoc`).

    Raises:
        ValueError: if `platform` has another form.
    """

    def __init__(self, protocol: type[Protocol], name: str, platform: str, conversation_id: str) -> None:
        identifier_on(platform, name)
        self._protocol = name
        self._platform = platform
        self._id = conversation_id
        self._decoder = msgspec.msgpack.Decoder(protocol.messages)
        self._fields = _fields_of(protocol)

    def acl_of(self, envelope: Envelope, sequence: int, reply_to: int | None = None) -> ACLMessage:
        """Return the ACL message of `envelope`, the sender's message number `sequence`.

        It is a reply to the receiver's message number `reply_to`, if that is given.

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
        """Return the envelope and the message of `acl`, checked by the protocol's own decoder.

        Raises:
            ACLError: if the message is not of this conversation, or not a message of the protocol.
        """
        for what, found, expected in (
            ("ontology", acl.ontology, ONTOLOGY),
            ("protocol", acl.protocol, self._protocol),
            ("conversation-id", acl.conversation_id, self._id),
        ):
            if found != expected:
                raise ACLError(f"{what} {_shown(found)} is to be {expected!r}")
        clock = dict(acl.user).get(CLOCK, "")
        if not _NUMBER.fullmatch(clock):
            raise ACLError(f"{CLOCK} {_shown(clock)} is to be a number of constraint checks")
        content = self._content(acl)
        message = self._decoded(content)
        performative = message.act.performative
        if acl.performative is not performative:
            raise ACLError(f"a message of type {type(message).__name__} is {performative}, not {acl.performative}")
        if acl.sender is None or len(acl.receiver) != 1:
            raise ACLError("an envelope has one sender and one receiver")
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
            raise ACLError(f"language and encoding {_shown(form)} are to be {forms}")
        try:
            return b64decode(said, validate=True)
        except ValueError as error:
            raise ACLError(f"the content is not valid base64: {error}") from None

    def _local(self, agent: AgentIdentifier) -> str:
        if agent.platform != self._platform:
            raise ACLError(f"{_shown(agent.name)} is not on the platform {self._platform!r}")
        return agent.local


def _fields_of(protocol: type[Protocol]) -> dict[str, tuple[str, ...]]:
    """Return the field names of each message type that is encoded as an array, by the type's tag."""
    return {
        kind.__struct_config__.tag: tuple(field.name for field in msgspec.structs.fields(kind))
        for kind in get_args(protocol.messages) or (protocol.messages,)
        if kind.__struct_config__.array_like
    }


def _json_of(content: bytes, fields: Mapping[str, Sequence[str]]) -> str | None:
    """Return `content` as JSON; None if that would lose information or be too long."""
    try:
        kind, *values = msgspec.msgpack.decode(content)
        said = [kind, {name: _plain(value, 0) for name, value in zip(fields[kind], values, strict=True)}]
        text = msgspec.json.encode(said).decode()
        return text if len(text) <= MAX_JSON and _content_of(text, fields) == content else None
    except (_InexpressibleError, msgspec.MsgspecError, LookupError, ValueError, TypeError, RecursionError):
        return None


def _content_of(text: str, fields: Mapping[str, Sequence[str]]) -> bytes:
    """Return the msgpack bytes of a content in JSON. Raises `ACLError`."""
    if len(text) > MAX_JSON:
        raise ACLError(f"a content of {len(text)} characters is too long: at most {MAX_JSON} as JSON")
    try:
        kind, given = msgspec.json.decode(text, type=tuple[str, dict[str, Any]])
        return msgspec.msgpack.encode([kind, *(_raw(given[name], 0) for name in _names(kind, given, fields))])
    except ACLError:
        raise
    except (msgspec.MsgspecError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise ACLError(f'the content is not JSON like ["Ok",{{"value":[3]}}]: {error}') from None


def _names(kind: str, given: Collection[str], fields: Mapping[str, Sequence[str]]) -> Sequence[str]:
    """Return the fields of `kind` in their order. Raises `ACLError` if `given` are other fields."""
    if kind not in fields:
        raise ACLError(f"there is no message {_shown(kind)}, only {', '.join(fields)}")
    names = fields[kind]
    if set(names) != set(given):
        raise ACLError(f"{kind} has the fields {_shown(list(names))}, not {_shown(sorted(given))}")
    return names


def _plain(value: object, depth: int) -> object:
    """Return `value`, decoded from msgpack, in JSON form. Raises `_InexpressibleError`."""
    match value:
        case None | bool() | int() | str():
            return value
        case float():
            return value if math.isfinite(value) else {"float": str(value)}
        case bytes():
            return {"base64": b64encode(value).decode()}
        case list() | tuple() if depth < _DEPTH:
            return [_plain(one, depth + 1) for one in value]
        case dict() if depth < _DEPTH:
            members = {key: _plain(one, depth + 1) for key, one in value.items()}
            if all(isinstance(key, str) for key in members) and not _is_mark(members):
                return members
            return {"map": [[_plain(key, depth + 1), one] for key, one in members.items()]}
    raise _InexpressibleError


def _raw(value: Any, depth: int) -> Any:  # noqa: ANN401 - any JSON
    """Return the value that `_plain` was given. Raises `ValueError` and others for any other input."""
    if depth > _DEPTH:
        raise ValueError(f"lists within lists deeper than {_DEPTH}")
    if isinstance(value, list):
        return [_raw(one, depth + 1) for one in value]
    if not isinstance(value, dict):
        return value
    if not _is_mark(value):
        return {key: _raw(one, depth + 1) for key, one in value.items()}
    ((mark, given),) = value.items()
    if mark == "base64" and isinstance(given, str):
        return b64decode(given, validate=True)
    if mark == "float" and given in _NOT_FINITE:
        return _NOT_FINITE[given]
    if mark == "map" and isinstance(given, list):
        return {_key(_raw(key, depth + 1)): _raw(one, depth + 1) for key, one in given}
    raise ValueError(f"invalid value for {mark}")


def _is_mark(members: Mapping[Any, object]) -> bool:
    return len(members) == 1 and next(iter(members)) in _MARKS


def _key(value: object) -> object:
    """Return a key for a msgpack map: lists cannot be keys, so they become tuples."""
    return tuple(map(_key, value)) if isinstance(value, list) else value


def _shown(found: object) -> str:
    """Return a short form of foreign input for an error message."""
    shown = repr(found)
    return shown if len(shown) <= 80 else f"{shown[:80]}..."  # noqa: PLR2004 - a line's worth
