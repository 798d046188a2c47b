"""FIPA ACL: every message of every protocol has its form, which others can read, and is the same again."""

from __future__ import annotations

import doctest
import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from random import Random
from types import UnionType
from typing import Annotated, Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import pytest
import sexpdata
from cost_problems import random_cost_team
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import random_team

import robochoc.communication.acl
from robochoc.communication.acl import ACLMessage, BadACL, parse, text
from robochoc.communication.conversation import MAX_JSON, Conversation
from robochoc.communication.performatives import ACTS, OTHERWISE, act_of
from robochoc.communication.schedule import RandomChannels
from robochoc.communication.simulator import Simulation
from robochoc.message import Envelope, Message, encode
from robochoc.protocols.abt import ABT, Nogood, Ok
from robochoc.protocols.first_fit import FirstFit
from robochoc.protocols.protocol import Protocol
from robochoc.registry import protocol_named, protocol_names
from robochoc.services.communicative_acts import Performative
from robochoc.services.descriptions import AgentDescription, ServiceDescription
from robochoc.services.directory import Directory
from robochoc.services.facilitator import handle
from robochoc.services.identifier import AgentIdentifier
from robochoc.services.sl import REQUEST_CAPS, Function, df_on, request
from robochoc.services.symbolic import Expression, read

PLATFORM = "192.168.1.14:7447/robochoc"
DOCS = (Path(__file__).parents[1] / "docs" / "acl.md").read_text()
OURS = [name for name in protocol_names() if protocol_named(name).__module__.startswith("robochoc.")]
EVERY_PROTOCOL = pytest.mark.parametrize("protocol", OURS)


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


# The table


def table() -> str:
    speakers: dict[str, list[str]] = {}
    for protocol in OURS:
        for kind in types_of(protocol_named(protocol)):
            speakers.setdefault(kind.__name__, []).append(protocol)
    rows = [
        f"| {kind} | {act.performative.upper()} | {act.why} | {', '.join(speakers[kind])} |"
        for kind, act in ACTS.items()
    ]
    return "\n".join(["| message | performative | why | protocols |", "| --- | --- | --- | --- |", *rows])


def test_the_table_is_complete_and_has_nothing_else() -> None:
    ours = {kind.__name__ for name in OURS for kind in types_of(protocol_named(name))}
    assert set(ACTS) == ours
    assert list(ACTS) == sorted(ACTS)


def test_the_documented_table_is_the_table() -> None:
    assert table() in DOCS


def test_types_that_are_not_ours_inform() -> None:
    assert act_of("Breakout") is OTHERWISE
    assert OTHERWISE.performative is Performative.INFORM


# Every message of every protocol


class Recording(RandomChannels):
    """Any channel next; keeps the first few different messages of each type."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.seen: dict[str, dict[bytes, Envelope]] = {}

    def put(self, envelope: Envelope) -> None:
        kind = msgspec.msgpack.decode(envelope.content)[0]
        kept = self.seen.setdefault(kind, {})
        if len(kept) < 10:
            kept.setdefault(envelope.content, envelope)
        super().put(envelope)


@EVERY_PROTOCOL
def test_messages_of_runs_are_the_same_again(protocol: str) -> None:
    offered = protocol_named(protocol)
    talk = conversation(protocol)
    kinds = {kind.__name__ for kind in types_of(offered)}
    seen: set[str] = set()
    for seed in range(60):
        if seed >= 3 and seen == kinds:
            break
        chance = Random(seed)
        make = random_cost_team if offered.traits.costs else random_team
        schedule = Recording(seed)
        with Simulation(make(chance, n_ary=offered.traits.n_ary), offered, schedule) as session:
            session.search(messages=800)
        for kind, envelopes in schedule.seen.items():
            seen.add(kind)
            for number, envelope in enumerate(envelopes.values()):
                acl = returned(talk, envelope, number, number + 1)
                assert acl.language == "json"
                assert acl.performative is ACTS[kind].performative
                assert_others_read(acl)
    assert seen == kinds


SIMPLE: dict[Any, st.SearchStrategy[Any]] = {
    int: st.integers(-(2**63), 2**64 - 1),
    float: st.floats(allow_nan=False),
    str: st.text(max_size=5),
    bytes: st.binary(max_size=20),
    bool: st.booleans(),
    type(None): st.none(),
}


def values_of(hint: Any) -> st.SearchStrategy[Any]:  # noqa: ANN401 - any type
    """Values of a type that messages have."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint in SIMPLE:
        return SIMPLE[hint]
    if origin is None:
        return messages_of(hint)
    if origin is Annotated:
        return st.integers(arguments[1].ge, 2**50)
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
            if field[0] != "_"
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
    @settings(max_examples=30, deadline=None)
    def check(message: Message, names: tuple[str, str], clock: int) -> None:
        assert returned(talk, Envelope(*names, encode(message), clock), 7).language == "json"

    check()


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


# "inf" and its like are words of FIPA's, and numbers for sexpdata.
TEXTS = st.text(max_size=6).filter(lambda word: word.lower() not in ("inf", "nan", "infinity"))
AGENTS = st.builds(AgentIdentifier, TEXTS.filter(bool), st.lists(TEXTS, max_size=2).map(tuple))
SETS = st.lists(
    st.builds(AgentIdentifier, TEXTS.filter(bool), resolvers=st.lists(AGENTS, max_size=2).map(tuple)), max_size=2
)
MAYBE = st.none() | TEXTS


@given(
    st.builds(
        ACLMessage,
        st.sampled_from(Performative),
        st.none() | AGENTS,
        SETS.map(tuple),
        SETS.map(tuple),
        *[MAYBE] * 8,
        st.sampled_from((None, "20260131T120000000Z", "20260131T120000000", "+00000000T000030000")),
        st.dictionaries(st.from_regex(r"\Ax-[a-z0-9_.-]{1,9}\Z"), TEXTS, max_size=3).map(lambda user: (*user.items(),)),
    )
)
@settings(deadline=None)
def test_any_acl_message_is_the_same_again_and_others_read_it(acl: ACLMessage) -> None:
    assert parse(text(acl)) == acl
    if acl.reply_by is None or acl.reply_by.endswith("Z"):
        assert_others_read(acl)


def test_messages_of_others_are_read_in_any_case_and_layout() -> None:
    foreign = """(inform
      :SENDER ( agent-identifier :name df@10.1.2.3:1099/JADE :addresses (sequence http://host:7778/acc) :X-seen yes )
      :receiver (set ( Agent-Identifier :name "b c@p" ) )
      :content #12"("done" (x)) :reply-by 20260131T120000000Z :X-JADE-Trace 17 :conversation-id c1)"""
    assert parse(foreign) == ACLMessage(
        Performative.INFORM,
        AgentIdentifier("df@10.1.2.3:1099/JADE", ("http://host:7778/acc",)),
        (AgentIdentifier("b c@p"),),
        content='("done" (x))',
        reply_by="20260131T120000000Z",
        conversation_id="c1",
        user=(("x-jade-trace", "17"),),
    )


@pytest.mark.parametrize(
    ("bad", "message", "at"),
    [
        ("", "no expression", 0),
        ("INFORM", "begins with a word", 0),
        ("()", "begins with a word", 0),
        (" (SHOUT)", "'shout' is no performative", 1),
        ("(INFORM :sender", "ends before", 15),
        ("(INFORM :sender)", "has no value", 8),
        ("(INFORM sender a)", "begin with a colon", 8),
        ("(INFORM :sender a)", "agent-identifier is to be a list", 16),
        ("(INFORM :sender (agent-identifier))", "needs a :name", 16),
        ("(INFORM :sender (agent-identifier :name (a)))", "not a list", 40),
        ("(INFORM :receiver (agent-identifier :name a))", "begin with set", 18),
        ("(INFORM :language (a b))", "not a list", 18),
        ("(INFORM :colour red)", "no parameter :colour", 16),
        ("(INFORM :language a :Language b)", "twice", 20),
        ("(INFORM :X-a! b)", "no name of a user-defined parameter", 0),
        ("(INFORM :reply-by soon)", "no DateTime", 0),
        ('(INFORM :content "a)', "never closed", 17),
        ("(INFORM :content " + "(" * 40, "deeper", 32),
        ("(INFORM" + " a" * 10_001, "more than 10000", 20_004),
        ("(INFORM :content " + "a" * (1 << 25) + ")", "too many", 1 << 25),
    ],
)
def test_bad_texts_are_told_with_their_place(bad: str, message: str, at: int) -> None:
    with pytest.raises(BadACL, match=message) as caught:
        parse(bad)
    assert caught.value.at == at
    assert len(str(caught.value)) < 200


@given(st.text(alphabet='()": \\#:aX-0', max_size=60))
@settings(max_examples=300)
def test_any_text_is_a_message_or_bad(anything: str) -> None:
    for whole in (anything, f"(INFORM {anything})", f"(INFORM :sender (agent-identifier {anything}))"):
        try:
            acl = parse(whole)
        except BadACL:
            continue
        assert parse(text(acl)) == acl


def test_a_user_defined_parameter_is_given_once() -> None:
    with pytest.raises(ValueError, match="twice"):
        ACLMessage(Performative.INFORM, user=(("x-a", "1"), ("x-a", "2")))


# Envelopes


OK = Envelope("Robot3.1", "Robot4.1", encode(Ok((3,))), 17)


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
    with pytest.raises(BadACL, match=re.escape(message)) as caught:
        conversation().envelope_of(forged)
    assert caught.value.at is None
    assert len(str(caught.value)) < 300


def test_what_is_no_message_has_no_acl_message() -> None:
    for content in (b"", b"\xc0", encode(Ok((3,)))[:-1], b"\x91" * 100_000):
        with pytest.raises(BadACL, match="no message of abt"):
            conversation().acl_of(OK._replace(content=content), 1)


def test_bounds_that_are_infinite_are_words() -> None:
    from robochoc.protocols.adopt import Cost  # noqa: PLC0415

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


# The documentation


def example(number: int) -> Expression:
    return read(re.findall(r"```lisp\n(.*?)```", DOCS, re.DOTALL)[number], REQUEST_CAPS)


def test_the_documented_message_is_ours() -> None:
    assert example(0) == read(text(conversation().acl_of(OK, 12, 9)), REQUEST_CAPS)


def test_the_documented_words_with_the_directory_are_ours() -> None:
    directory, df, robot = Directory(), df_on(PLATFORM), f"Robot3.1@{PLATFORM}"
    variables = ServiceDescription("variables", "robochoc-variables", properties=(("X31", "0..3"),))
    own = AgentDescription(robot, (variables,), ("abt",), ("robochoc",), ("json",), 30.0)
    asked = [
        request(df, Function.REGISTER, own),
        request(df, Function.SEARCH, AgentDescription(protocols=("abt",)), 10),
        request(df, Function.REGISTER, AgentDescription(robot)),
        request(df, Function.DEREGISTER, AgentDescription(f"Robot4.1@{PLATFORM}")),
    ]
    answers = [handle(directory, robot, one, 0.0) for one in asked]
    said = [asked[0], answers[0][1], asked[1], answers[1][1], answers[2][1], answers[3][1]]
    for number, content in enumerate(said, 1):
        assert example(number) == read(content, REQUEST_CAPS), content
    assert [str(answer[0]) for answer in answers] == ["inform", "inform", "failure", "refuse"]


def test_the_example_runs() -> None:
    assert doctest.testmod(robochoc.communication.acl).failed == 0
