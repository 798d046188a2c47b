"""The messages of every protocol: as FIPA ACL they are the same again, and they have their words."""

from __future__ import annotations

from collections.abc import Sequence
from enum import EnumType
from functools import cache
from random import Random
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.problem import Team
from robochoc.protocols.message import Envelope, Message, encode
from robochoc.protocols.private.p_dsa import PDSA
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.mediation import AllowedTable
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.run.registry import protocol_named
from robochoc.sniffer.acl import parse
from robochoc.sniffer.acl_messages import PLATFORM, Conversation
from robochoc.solver.agent_problem import RunParameters
from tests.support.acl_conversations import BUNDLED_PROTOCOLS, assert_others_read, conversation, returned, types_of
from tests.support.allocation_problems import simple_allocation_team
from tests.support.asymmetric_problems import random_asymmetric_team
from tests.support.cost_problems import random_cost_team
from tests.support.examples import examples
from tests.support.problems import random_team
from tests.support.real_sentences import REAL
from tests.support.recorded_journals import feed_of, words_of

pytestmark = pytest.mark.usefixtures("quick_encryption")


@pytest.mark.parametrize("protocol", BUNDLED_PROTOCOLS)
def test_messages_are_the_same_again_and_have_words(protocol: str) -> None:
    messages_of_random_runs_are_the_same_again(protocol)
    any_message_is_the_same_again(protocol)
    messages_of_a_journal_are_those_of_its_conversation(protocol)

    said = words_of(feed_of(protocol))
    assert all(" says: " in sentence for sentences in said.values() for sentence in sentences)
    expected = {kind: sentence for (of, kind), sentence in REAL.items() if of == protocol}
    assert {kind: sentence for kind, sentence in expected.items() if sentence not in said[kind]} == {}


def test_all_sentences_are_those_of_a_protocol() -> None:
    assert {protocol for protocol, _ in REAL} <= {*BUNDLED_PROTOCOLS}


# In random runs


class Recording(RandomChannels):
    """Any channel next; keep the first few different messages of each type."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.seen: dict[str, dict[bytes, Envelope]] = {}

    def put(self, envelope: Envelope, checks: int = 0) -> None:
        kind = msgspec.msgpack.decode(envelope.content)[0]
        kept = self.seen.setdefault(kind, {})
        if len(kept) < 5:
            kept.setdefault(envelope.content, envelope)
        super().put(envelope, checks)


AFTER_CHANGES = {"Check", "Reuse"}
"""Types of dynamic protocols that are sent only once a problem has changed."""
FROM_SEVERAL_VARIABLES = {"SplitDimensions"}
"""Types that only robots with several variables send."""


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
    if hasattr(protocol.settings, "search"):
        return {"search": "hidden"}
    if protocol is PDSA:
        return {"cycles": "1"}
    anytime = {kind.__name__ for kind in get_args(AnytimeMessage)}
    return {"anytime": "yes", "cycles": "4"} if anytime <= {kind.__name__ for kind in types_of(protocol)} else {}


def messages_of_random_runs_are_the_same_again(protocol: str) -> None:
    """Each type of message is sent in one of them."""
    offered = protocol_named(protocol)
    talk = conversation(protocol)
    kinds = {kind.__name__: kind for kind in types_of(offered)}
    expected = {*kinds} - FROM_SEVERAL_VARIABLES - (AFTER_CHANGES if offered.traits.dynamic else set())
    seen: set[str] = set()
    for seed in range(60):
        if seed >= 2 and seen - FROM_SEVERAL_VARIABLES == expected:
            break
        chance = Random(seed)
        schedule = Recording(seed)
        team, settings = a_team(offered, chance), other_settings(offered) if seed % 2 else {}
        with Simulation(team, offered, schedule, parameters=RunParameters(settings=settings)) as session:
            session.search(messages=4_000 if settings else 800)
        for kind, envelopes in schedule.seen.items():
            seen.add(kind)
            for number, envelope in enumerate(envelopes.values()):
                acl = returned(talk, envelope, number, number + 1)
                assert acl.language == "json"
                assert acl.performative is kinds[kind].act.performative
                assert_others_read(acl)
    assert seen - FROM_SEVERAL_VARIABLES == expected


# Any that could be


SIMPLE: dict[Any, st.SearchStrategy[Any]] = {
    int: st.integers(-(2**63), 2**64 - 1),
    float: st.floats(allow_nan=False),
    str: st.text(max_size=5),
    bytes: st.binary(max_size=20),
    bool: st.booleans(),
    type(None): st.none(),
    AllowedTable: st.integers(1, 20).map(lambda size: AllowedTable(("RA",), (size,), bytes(-(-size // 8)))),
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


def any_message_is_the_same_again(protocol: str) -> None:
    talk = conversation(protocol)

    @given(
        message=st.one_of(*map(messages_of, types_of(protocol_named(protocol)))),
        names=st.tuples(st.text(min_size=1, max_size=5), st.text(min_size=1, max_size=5)),
        clock=st.integers(0, 10**18 - 1),
    )
    @examples(15)
    def check(message: Message, names: tuple[str, str], clock: int) -> None:
        assert returned(talk, Envelope(*names, encode(message), clock), 7).language == "json"

    check()


# In a journal


def messages_of_a_journal_are_those_of_its_conversation(protocol: str) -> None:
    """`Conversation` returns from the ACL message what the journal holds."""
    feed = feed_of(protocol)
    trace, of = feed.trace, feed.trace.messages
    talk = Conversation(protocol_named(protocol), protocol, PLATFORM, "run-1")
    for message in range(0, len(of.t), max(1, len(of.t) // 60)):
        acl = parse(feed.detail(message)["acl"])
        if "NaN" in str(acl) or _has_infinity(trace.content(message)):
            continue
        envelope, said = talk.envelope_of(acl)
        assert (envelope.sender, envelope.receiver) == (
            trace.robots[of.sender[message]],
            trace.robots[of.receiver[message]],
        )
        assert (envelope.clock, len(envelope.content)) == (of.clock[message], of.bytes[message])
        assert type(said).__name__ == trace.kinds[of.kind[message]]
        assert acl.reply_with == f"{envelope.sender}/{of.sequence[message]}"
        answered = [cause for cause in trace.causes(message) if of.sender[cause] == of.receiver[message]]
        expected = f"{envelope.receiver}/{of.sequence[answered[0]]}" if len(answered) == 1 else None
        assert acl.in_reply_to == expected


def _has_infinity(content: object) -> bool:
    """Journals that are JSON have null for it."""
    match content:
        case None:
            return True
        case dict():
            return any(map(_has_infinity, content.values()))
        case list():
            return any(map(_has_infinity, content))
        case _:
            return False
