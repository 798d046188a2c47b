"""FIPA ACL: the parameters of a message, and what no robot would send."""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime
from typing import Any, ClassVar

import msgspec
import pytest

from robochoc.protocols.acts import Performative
from robochoc.protocols.message import Message, encode
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.services.identifier import AgentIdentifier
from robochoc.sniffer.acl import ACLError, ACLMessage
from robochoc.sniffer.acl_messages import MAX_JSON, Conversation
from tests.support.acl_conversations import (
    OK,
    PLATFORM,
    conversation,
    returned,
)
from tests.support.cases import cases


def test_an_envelope_has_all_parameters_that_apply() -> None:
    assert conversation().acl_of(OK, 5, 4) == ACLMessage(
        Performative.INFORM,
        AgentIdentifier(f"Robot3.1@{PLATFORM}"),
        (AgentIdentifier(f"Robot4.1@{PLATFORM}"),),
        content='["Ok",{"value":[3]}]',
        language="json",
        encoding="utf-8",
        ontology="robochoc",
        protocol="abt",
        conversation_id="run-1",
        reply_with="Robot3.1/5",
        in_reply_to="Robot4.1/4",
        user=(("x-clock", "17"),),
    )


FORGED: list[tuple[dict[str, Any], str]] = [
    ({"performative": Performative.REQUEST}, "the performative is request; that of Ok is inform"),
    ({"sender": None}, "one sender and one receiver"),
    ({"sender": AgentIdentifier("Robot3.1@elsewhere")}, "not on the platform"),
    ({"receiver": ()}, "one sender and one receiver"),
    ({"receiver": (AgentIdentifier(PLATFORM),)}, "not on the platform"),
    ({"ontology": None}, "ontology is None; it must be 'robochoc'"),
    ({"protocol": "afc"}, "protocol is 'afc'; it must be 'abt'"),
    ({"conversation_id": "run-2"}, "conversation-id is 'run-2'"),
    ({"user": ()}, "x-clock is ''"),
    ({"user": (("x-clock", "-1"),)}, "x-clock is '-1'"),
    ({"language": "fipa-sl"}, "json in utf-8 or msgpack in base64"),
    ({"language": "msgpack", "encoding": "base64"}, "not valid base64"),
    ({"language": "msgpack", "encoding": "base64", "content": "AAAA"}, "not a message of abt"),
    ({"content": None}, "not JSON like"),
    ({"content": "{}"}, "not JSON like"),
    ({"content": '["Fly",{}]'}, "the message type 'Fly' is unknown; known types: Ok, Nogood, AddLink"),
    ({"content": '["Ok",{"price":[3]}]'}, "the fields of Ok are ['value'], but this message has ['price']"),
    ({"content": '["Ok",{"value":["a"]}]'}, "not a message of abt"),
    ({"content": '["Ok",{"value":[36893488147419103232]}]'}, "not JSON like"),
    ({"content": '["Ok",{"value":{"base64":"?"}}]'}, "not JSON like"),
    ({"content": '["Ok",{"value":{"float":"1"}}]'}, "invalid value for float"),
    ({"content": '["Ok",{"value":{"float":[]}}]'}, "not JSON like"),
    ({"content": '["Ok",{"value":{"map":[1]}}]'}, "not JSON like"),
    ({"content": '["Ok",{"value":{"map":[[{"base64":"AA=="},1],[{"map":[]},1]]}}]'}, "not JSON like"),
    ({"content": '["Ok",{"value":' + "[" * 40 + "]" * 40 + "}]"}, "deeper than 32"),
]


def test_what_no_robot_would_send_is_no_envelope() -> None:
    with cases() as each:
        long: list[tuple[dict[str, str], str]] = [
            ({"content": "[" * 1_000_000}, "not JSON like"),
            ({"content": "[" + " " * MAX_JSON + "]"}, "characters, more than"),
        ]
        for changed, message in (*FORGED, *long):
            with each(message):
                forged = msgspec.structs.replace(conversation().acl_of(OK, 1), **changed)
                with pytest.raises(ACLError, match=re.escape(message)) as caught:
                    conversation().envelope_of(forged)
                assert caught.value.at is None
                assert len(str(caught.value)) < 300


def test_what_is_no_message_has_no_acl_message() -> None:
    for content in (b"", b"\xc0", encode(Ok((3,)))[:-1], b"\x91" * 100_000):
        with pytest.raises(ACLError, match="not a message of abt"):
            conversation().acl_of(msgspec.structs.replace(OK, content=content), 1)


def test_bounds_that_are_infinite_are_words() -> None:
    from robochoc.protocols.optimization.adopt_messages import Cost  # noqa: PLC0415

    acl = returned(
        conversation("adopt"), msgspec.structs.replace(OK, content=encode(Cost({"R1": ((2, None), 5)}, 0, math.inf))), 1
    )
    assert acl.content == '["Cost",{"context":{"R1":[[2,null],5]},"lb":0,"ub":{"float":"inf"}}]'


def test_names_that_look_like_marks_are_told_apart() -> None:
    acl = returned(conversation(), msgspec.structs.replace(OK, content=encode(Nogood({"base64": (1,)}, (2,)))), 1)
    assert acl.content == '["Nogood",{"lhs":{"map":[["base64",[1]]]},"value":[2]}]'


class Odd(Message, frozen=True):
    """What a user's protocol may say."""

    table: dict[int | tuple[int, int], float] = msgspec.field(default_factory=dict)
    when: datetime | None = None
    deep: Any = None


class Named(Message, frozen=True, array_like=False):
    """A message that travels as a map."""

    a: int


class Users(FirstFit):
    messages: ClassVar[Any] = Odd


class UsersNamed(FirstFit):
    messages: ClassVar[Any] = Named


def nested(depth: int) -> list[Any]:
    return [nested(depth - 1)] if depth else []


USERS_MESSAGES = [
    (Odd({7: 1.0, 8: -math.inf}), "json"),
    (Odd({(1, 2): 0.1}), "json"),
    (Odd(when=datetime(2026, 1, 31, tzinfo=UTC)), "msgpack"),
    (Odd(deep=nested(30)), "json"),
    (Odd(deep=nested(40)), "msgpack"),
    (Odd(deep=b"a" * MAX_JSON), "msgpack"),
    (Named(1), "msgpack"),
]


def test_messages_of_users_protocols_travel_too() -> None:
    for message, language in USERS_MESSAGES:
        talk = Conversation(UsersNamed if isinstance(message, Named) else Users, "users", PLATFORM, "run-1")
        acl = returned(talk, msgspec.structs.replace(OK, content=encode(message)), 1)
        assert (acl.language, acl.performative) == (language, Performative.INFORM)


def test_a_content_in_other_words_than_ours_travels_as_it_is() -> None:
    long_form = b"\x92\xa2Ok\x91\xd3" + (3).to_bytes(8, "big")
    assert returned(conversation(), msgspec.structs.replace(OK, content=long_form), 1).language == "msgpack"


def test_a_platform_needs_a_name_without_an_at() -> None:
    with pytest.raises(ValueError, match="need a name"):
        Conversation(ABT, "abt", "a@b", "run-1")
