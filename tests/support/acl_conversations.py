"""A conversation to be looked at as FIPA ACL, and an independent reader of its text."""

from __future__ import annotations

from typing import get_args

import sexpdata

from robochoc.protocols.message import Envelope, Message, encode
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.services.identifier import AgentIdentifier
from robochoc.sniffer.acl import ACLMessage, parse, text
from robochoc.sniffer.acl_messages import Conversation

PLATFORM = "192.168.1.14:7447/robochoc"
BUNDLED_PROTOCOLS = [name for name in protocol_names() if protocol_named(name).__module__.startswith("robochoc.")]


def types_of(protocol: type[Protocol]) -> tuple[type[Message], ...]:
    return get_args(protocol.messages) or (protocol.messages,)


def conversation(protocol: str = "abt") -> Conversation:
    return Conversation(protocol_named(protocol), protocol, PLATFORM, "run-1")


def returned(talk: Conversation, envelope: Envelope, *numbers: int) -> ACLMessage:
    """The ACL message of `envelope`, which is the same again after its way through text."""
    acl = talk.acl_of(envelope, *numbers)
    back = parse(text(acl))
    assert back == acl
    again, message = talk.envelope_of(back)
    assert again == envelope
    assert encode(message) == encode(talk.envelope_of(acl)[1])
    return acl


# What others read


def assert_others_read(acl: ACLMessage) -> None:
    """An independent parser of s-expressions finds in the text what is in `acl`."""
    found = sexpdata.loads(text(acl), nil=None, true=None)
    act, *rest = found
    keys, values = [str(key).lower() for key in rest[::2]], rest[1::2]
    told = dict(zip(keys, values, strict=True))
    assert len(told) == len(keys)
    assert str(act) == acl.performative.upper()
    expected: dict[str, object] = {f":{key}": value for key, value in acl.user}
    for slot in ACLMessage.__struct_fields__:
        value = getattr(acl, slot)
        if value not in (None, ()) and slot not in ("performative", "user"):
            expected[":" + slot.replace("_", "-")] = value
    assert set(told) == set(expected)
    for key, value in expected.items():
        assert plain(told[key]) == as_lists(value), key


def plain(found: object) -> object:
    if isinstance(found, list):
        return [plain(one) for one in found]
    if isinstance(found, sexpdata.Symbol):
        return found.value()
    assert isinstance(found, str), found
    return found


def as_lists(value: object) -> object:
    match value:
        case AgentIdentifier(name=name, addresses=addresses, resolvers=resolvers):
            whole: list[object] = ["agent-identifier", ":name", name]
            whole += [":addresses", ["sequence", *addresses]] if addresses else []
            return whole + ([":resolvers", ["sequence", *map(as_lists, resolvers)]] if resolvers else [])
        case tuple():
            return ["set", *map(as_lists, value)]
        case other:
            return other


# Envelopes


OK = Envelope("Robot3.1", "Robot4.1", encode(Ok((3,))), 17)
