"""FIPA ACL: every message of every protocol has its form, and is the same again."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from enum import EnumType
from functools import cache
from random import Random
from types import UnionType
from typing import Annotated, Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.communicative_acts import Performative
from robochoc.model.message import Envelope, Message, encode
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.protocols.satisfaction.messages.abt import Ok
from robochoc.protocols.satisfaction.messages.compapo import Table
from robochoc.protocols.satisfaction.messages.nogood import Nogood
from robochoc.protocols.shared.messages.anytime import AnytimeMessage
from robochoc.run.registry import protocol_named
from robochoc.services.identifier import AgentIdentifier
from robochoc.sniffer.acl import ACLError, ACLMessage
from robochoc.sniffer.conversation import MAX_JSON, Conversation
from robochoc.solver.agent_problem import RunParameters
from tests.support.acl_conversations import (
    EVERY_PROTOCOL,
    OK,
    PLATFORM,
    assert_others_read,
    conversation,
    returned,
    types_of,
)
from tests.support.allocation_problems import simple_allocation_team
from tests.support.asymmetric_problems import random_asymmetric_team
from tests.support.cost_problems import random_cost_team
from tests.support.examples import examples
from tests.support.problems import random_team

pytestmark = pytest.mark.usefixtures("quick_encryption")

# Every message of every protocol


class Recording(RandomChannels):
    """Any channel next; keeps the first few different messages of each type."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.seen: dict[str, dict[bytes, Envelope]] = {}

    def put(self, envelope: Envelope, checks: int = 0) -> None:
        kind = msgspec.msgpack.decode(envelope.content)[0]
        kept = self.seen.setdefault(kind, {})
        if len(kept) < 10:
            kept.setdefault(envelope.content, envelope)
        super().put(envelope, checks)


AFTER_CHANGES = {"Check", "Reuse"}
"""Types of dynamic protocols that are sent only once a problem has changed."""


def a_team(protocol: type[Protocol], chance: Random) -> Team:
    if protocol.traits.asymmetric:
        return random_asymmetric_team(chance)
    if protocol.traits.allocates:
        return simple_allocation_team(chance)
    make = random_cost_team if protocol.traits.costs else random_team
    return make(chance, n_ary=protocol.traits.n_ary)


def other_settings(protocol: type[Protocol]) -> dict[str, str]:
    """Settings with which robots send what they do not send without them."""
    if hasattr(protocol.settings, "phases"):
        return {"phases": "2"}
    if hasattr(protocol.settings, "heuristic"):
        return {"heuristic": "dp"}
    anytime = {kind.__name__ for kind in get_args(AnytimeMessage)}
    return {"anytime": "yes", "cycles": "4"} if anytime <= {kind.__name__ for kind in types_of(protocol)} else {}


@EVERY_PROTOCOL
def test_messages_of_runs_are_the_same_again(protocol: str) -> None:
    offered = protocol_named(protocol)
    talk = conversation(protocol)
    kinds = {kind.__name__: kind for kind in types_of(offered)}
    expected = {*kinds} - (AFTER_CHANGES if offered.traits.dynamic else set())
    seen: set[str] = set()
    for seed in range(60):
        if seed >= 3 and seen == expected:
            break
        chance = Random(seed)
        schedule = Recording(seed)
        team, settings = a_team(offered, chance), other_settings(offered) if seed % 2 else {}
        with Simulation(team, offered, schedule, parameters=RunParameters(settings=settings)) as session:
            session.search(messages=800)
        for kind, envelopes in schedule.seen.items():
            seen.add(kind)
            for number, envelope in enumerate(envelopes.values()):
                acl = returned(talk, envelope, number, number + 1)
                assert acl.language == "json"
                assert acl.performative is kinds[kind].act.performative
                assert_others_read(acl)
    assert seen == expected


SIMPLE: dict[Any, st.SearchStrategy[Any]] = {
    int: st.integers(-(2**63), 2**64 - 1),
    float: st.floats(allow_nan=False),
    str: st.text(max_size=5),
    bytes: st.binary(max_size=20),
    bool: st.booleans(),
    type(None): st.none(),
    Table: st.integers(1, 20).map(lambda size: Table(("RA",), (size,), bytes(-(-size // 8)))),
}


def values_of(hint: Any) -> st.SearchStrategy[Any]:  # noqa: ANN401 - any type
    """Values of a type that messages have."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint in SIMPLE:
        return SIMPLE[hint]
    if origin is None:
        return st.sampled_from([*hint]) if isinstance(hint, EnumType) else messages_of(hint)
    if origin is Annotated:
        if arguments[0] is str:  # digits, the only text that messages bound
            return st.integers(0, 2**80).map("{:x}".format)
        return st.integers(arguments[1].ge, min(arguments[1].le or 2**50, 2**50))
    if origin is Literal:
        return st.sampled_from(arguments)
    within = [values_of(argument) for argument in arguments if argument is not Ellipsis]
    kinds: dict[Any, st.SearchStrategy[Any]] = {
        dict: st.dictionaries(within[0] | st.just("base64"), within[-1], max_size=3),
        list: st.lists(within[0], max_size=3),
        Sequence: st.lists(within[0], max_size=3),
        tuple: st.lists(within[0], max_size=3).map(tuple) if Ellipsis in arguments else st.tuples(*within),
        UnionType: st.one_of(within),
        Union: st.one_of(within),
    }
    return kinds[origin]


@cache
def messages_of(kind: type[msgspec.Struct]) -> st.SearchStrategy[Any]:
    return st.builds(
        kind,
        **{
            field: values_of(hint)
            for field, hint in get_type_hints(kind, include_extras=True).items()
            if field in kind.__struct_fields__
        },
    )


@EVERY_PROTOCOL
def test_any_message_is_the_same_again(protocol: str) -> None:
    talk = conversation(protocol)

    @given(
        message=st.one_of(*map(messages_of, types_of(protocol_named(protocol)))),
        names=st.tuples(st.text(min_size=1, max_size=5), st.text(min_size=1, max_size=5)),
        clock=st.integers(0, 10**18 - 1),
    )
    @examples(30)
    def check(message: Message, names: tuple[str, str], clock: int) -> None:
        assert returned(talk, Envelope(*names, encode(message), clock), 7).language == "json"

    check()


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


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"performative": Performative.REQUEST}, "Ok is inform, not request"),
        ({"sender": None}, "one sender and one receiver"),
        ({"sender": AgentIdentifier("Robot3.1@elsewhere")}, "not on the platform"),
        ({"receiver": ()}, "one sender and one receiver"),
        ({"receiver": (AgentIdentifier(PLATFORM),)}, "not on the platform"),
        ({"ontology": None}, "ontology None is to be 'robochoc'"),
        ({"protocol": "afc"}, "protocol 'afc' is to be 'abt'"),
        ({"conversation_id": "run-2"}, "conversation-id 'run-2'"),
        ({"user": ()}, "x-clock ''"),
        ({"user": (("x-clock", "-1"),)}, "x-clock '-1'"),
        ({"language": "fipa-sl"}, "json in utf-8 or msgpack in base64"),
        ({"language": "msgpack", "encoding": "base64"}, "no base64"),
        ({"language": "msgpack", "encoding": "base64", "content": "AAAA"}, "no message of abt"),
        ({"content": None}, "no JSON like"),
        ({"content": "{}"}, "no JSON like"),
        ({"content": '["Fly",{}]'}, "there is no message 'Fly', only Ok, Nogood, AddLink"),
        ({"content": '["Ok",{"price":[3]}]'}, "Ok has the fields ['value'], not ['price']"),
        ({"content": '["Ok",{"value":["a"]}]'}, "no message of abt"),
        ({"content": '["Ok",{"value":[36893488147419103232]}]'}, "no JSON like"),
        ({"content": '["Ok",{"value":{"base64":"?"}}]'}, "no JSON like"),
        ({"content": '["Ok",{"value":{"float":"1"}}]'}, "what stands for float is wrong"),
        ({"content": '["Ok",{"value":{"float":[]}}]'}, "no JSON like"),
        ({"content": '["Ok",{"value":{"map":[1]}}]'}, "no JSON like"),
        ({"content": '["Ok",{"value":{"map":[[{"base64":"AA=="},1],[{"map":[]},1]]}}]'}, "no JSON like"),
        ({"content": '["Ok",{"value":' + "[" * 40 + "]" * 40 + "}]"}, "deeper than 32"),
        ({"content": "[" * 1_000_000}, "no JSON like"),
        ({"content": "[" + " " * MAX_JSON + "]"}, "too long"),
    ],
)
def test_what_no_robot_would_send_is_no_envelope(changed: dict[str, Any], message: str) -> None:
    forged = msgspec.structs.replace(conversation().acl_of(OK, 1), **changed)
    with pytest.raises(ACLError, match=re.escape(message)) as caught:
        conversation().envelope_of(forged)
    assert caught.value.at is None
    assert len(str(caught.value)) < 300


def test_what_is_no_message_has_no_acl_message() -> None:
    for content in (b"", b"\xc0", encode(Ok((3,)))[:-1], b"\x91" * 100_000):
        with pytest.raises(ACLError, match="no message of abt"):
            conversation().acl_of(OK._replace(content=content), 1)


def test_bounds_that_are_infinite_are_words() -> None:
    from robochoc.protocols.optimization.messages.adopt import Cost  # noqa: PLC0415

    acl = returned(conversation("adopt"), OK._replace(content=encode(Cost({"R1": ((2, None), 5)}, 0, math.inf))), 1)
    assert acl.content == '["Cost",{"context":{"R1":[[2,null],5]},"lb":0,"ub":{"float":"inf"}}]'


def test_names_that_look_like_marks_are_told_apart() -> None:
    acl = returned(conversation(), OK._replace(content=encode(Nogood({"base64": (1,)}, (2,)))), 1)
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


@pytest.mark.parametrize(
    ("message", "language"),
    [
        (Odd({7: 1.0, 8: -math.inf}), "json"),
        (Odd({(1, 2): 0.1}), "json"),
        (Odd(when=datetime(2026, 1, 31, tzinfo=UTC)), "msgpack"),
        (Odd(deep=nested(30)), "json"),
        (Odd(deep=nested(40)), "msgpack"),
        (Odd(deep=b"a" * MAX_JSON), "msgpack"),
        (Named(1), "msgpack"),
    ],
)
def test_messages_of_users_protocols_travel_too(message: Message, language: str) -> None:
    talk = Conversation(UsersNamed if isinstance(message, Named) else Users, "users", PLATFORM, "run-1")
    acl = returned(talk, OK._replace(content=encode(message)), 1)
    assert (acl.language, acl.performative) == (language, Performative.INFORM)


def test_a_content_in_other_words_than_ours_travels_as_it_is() -> None:
    long_form = b"\x92\xa2Ok\x91\xd3" + (3).to_bytes(8, "big")
    assert returned(conversation(), OK._replace(content=long_form), 1).language == "msgpack"


def test_a_platform_needs_a_name_without_an_at() -> None:
    with pytest.raises(ValueError, match="need a name"):
        Conversation(ABT, "abt", "a@b", "run-1")
