"""FIPA ACL: the table of performatives, the text that others read, and what the documentation says of it."""

from __future__ import annotations

import doctest
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robochoc.sniffer.acl
from robochoc.protocols.acts import Performative
from robochoc.protocols.message import Message
from robochoc.run.registry import protocol_named
from robochoc.services.descriptions import AgentDescription, ServiceDescription
from robochoc.services.directory import Directory
from robochoc.services.facilitator import handle
from robochoc.services.identifier import AgentIdentifier
from robochoc.services.sl import REQUEST_CAPS, DirectoryFunction, df_on, request
from robochoc.services.symbolic import Expression, read
from robochoc.sniffer.acl import ACLError, ACLMessage, parse, text
from tests.support.acl_conversations import (
    BUNDLED_PROTOCOLS,
    OK,
    PLATFORM,
    assert_others_read,
    conversation,
    types_of,
)
from tests.support.cases import cases
from tests.support.examples import examples
from tests.support.program import ROOT

DOCS = (ROOT / "docs" / "guides" / "acl.md").read_text()


# The acts

ACTS = {kind.__name__: kind.act for name in BUNDLED_PROTOCOLS for kind in types_of(protocol_named(name))}


def test_types_of_one_name_do_the_same_in_all_of_our_protocols() -> None:
    for name in BUNDLED_PROTOCOLS:
        for kind in types_of(protocol_named(name)):
            assert kind.act == ACTS[kind.__name__], kind


def test_the_documented_examples_are_what_the_messages_declare() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([A-Z-]+) \| (.*) \|$", DOCS, re.MULTILINE)
    assert len(rows) > 5
    for kind, performative, why in rows:
        assert (performative, why) == (ACTS[kind].performative.upper(), ACTS[kind].why)


def test_a_message_that_declares_no_act_informs() -> None:
    class Bid(Message, frozen=True):
        price: int

    assert Bid.act.performative is Performative.INFORM


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


BAD_TEXTS: list[tuple[str, str, int]] = [
    ("", "no expression", 0),
    ("INFORM", "begins with a word", 0),
    ("()", "begins with a word", 0),
    (" (SHOUT)", "'shout' is not a performative", 1),
    ("(INFORM :sender", "ends before", 15),
    ("(INFORM :sender)", "has no value", 8),
    ("(INFORM sender a)", "begin with a colon", 8),
    ("(INFORM :sender a)", "agent-identifier must be a list", 16),
    ("(INFORM :sender (agent-identifier))", "needs a :name", 16),
    ("(INFORM :sender (agent-identifier :name (a)))", "not a list", 40),
    ("(INFORM :receiver (agent-identifier :name a))", "begin with set", 18),
    ("(INFORM :language (a b))", "not a list", 18),
    ("(INFORM :colour red)", "the parameter :colour is unknown", 16),
    ("(INFORM :language a :Language b)", "twice", 20),
    ("(INFORM :X-a! b)", "not a valid name of a user-defined parameter", 0),
    ("(INFORM :reply-by soon)", "not a DateTime", 0),
    ('(INFORM :content "a)', "never closed", 17),
    ("(INFORM :content " + "(" * 40, "deeper", 32),
    ("(INFORM" + " a" * 10_001, "more than 10000", 20_004),
]


def test_bad_texts_are_told_with_their_place() -> None:
    with cases() as each:
        for bad, message, at in BAD_TEXTS:
            with each(f"{bad:.50}"):
                with pytest.raises(ACLError, match=message) as caught:
                    parse(bad)
                assert caught.value.at == at
                assert len(str(caught.value)) < 200
    with pytest.raises(ACLError, match="too many") as caught:
        parse("(INFORM :content " + "a" * (1 << 25) + ")")
    assert caught.value.at == 1 << 25


@given(st.text(alphabet='()": \\#:aX-0', max_size=60))
@examples(300)
def test_any_text_is_a_message_or_bad(anything: str) -> None:
    for whole in (anything, f"(INFORM {anything})", f"(INFORM :sender (agent-identifier {anything}))"):
        try:
            acl = parse(whole)
        except ACLError:
            continue
        assert parse(text(acl)) == acl


def test_a_user_defined_parameter_is_given_once() -> None:
    with pytest.raises(ValueError, match="more than once"):
        ACLMessage(Performative.INFORM, user=(("x-a", "1"), ("x-a", "2")))


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
        request(df, DirectoryFunction.REGISTER, own),
        request(df, DirectoryFunction.SEARCH, AgentDescription(protocols=("abt",)), 10),
        request(df, DirectoryFunction.REGISTER, AgentDescription(robot)),
        request(df, DirectoryFunction.DEREGISTER, AgentDescription(f"Robot4.1@{PLATFORM}")),
    ]
    answers = [handle(directory, robot, one, 0.0) for one in asked]
    said = [asked[0], answers[0][1], asked[1], answers[1][1], answers[2][1], answers[3][1]]
    for number, content in enumerate(said, 1):
        assert example(number) == read(content, REQUEST_CAPS), content
    assert [str(answer[0]) for answer in answers] == ["inform", "inform", "failure", "refuse"]


def test_the_example_runs() -> None:
    assert doctest.testmod(robochoc.sniffer.acl).failed == 0
