"""What messages say, in words: right for every type, and words for whatever a journal holds."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from random import Random
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Sent
from robochoc.model.orders import Order
from robochoc.model.problem import Team
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.protocols.shared.messages.dfs import Token
from robochoc.protocols.wording import Wording
from robochoc.run import Options, Runtime, Withdrawal
from robochoc.run.registry import protocol_named
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.sentences import JournalSentences, sentence
from robochoc.sniffer.trace import Trace
from robochoc.system.plain_text import listed
from tests.support.acl_conversations import BUNDLED_PROTOCOLS, types_of
from tests.support.cases import cases
from tests.support.complex_problems import random_complex_team
from tests.support.examples import examples
from tests.support.problems import random_team
from tests.support.random_changes import random_changing_team
from tests.support.recorded_journals import record, words_of

PROTOCOLS: list[type[Protocol]] = [*map(protocol_named, BUNDLED_PROTOCOLS), FirstFit]
TYPES: list[type[Message]] = sorted(
    {kind for protocol in PROTOCOLS for kind in types_of(protocol)}, key=lambda kind: (kind.__name__, kind.__module__)
)


def test_every_type_of_every_protocol_has_its_words() -> None:
    assert [kind for kind in TYPES if kind.in_words is Message.in_words] == []


def test_a_solution_that_is_found_and_who_steps_aside() -> None:
    team = random_team(Random(3))
    options = Options(protocol="afc-ng", runtime=Runtime.SIMULATOR, cache=False)
    told = words_of(PageData(Trace.of(record(team, options))))
    (solved,) = told["Solved"]
    assert solved.startswith(f"{team.order[-1]} says: a solution is found, and the search is over: ")
    options = Options(protocol="abt", runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MAXIMAL, cache=False)
    told = words_of(PageData(Trace.of(record(queens3d(3), options))))
    assert "Robot1.1 says: I fly, with V1.1 = 1" in told["Placed"]
    assert any(sentence.endswith("says: I withdraw") for sentence in told["Placed"])


def test_a_tree_names_the_robots_on_the_branch_only() -> None:
    for seed in range(40):
        team = random_team(Random(seed))
        feed = PageData(Trace.of(record(team, Options(protocol="afc-tree", runtime=Runtime.SIMULATOR, cache=False))))
        told = words_of(feed)
        if any(len(one) > 30 for one in told.get("CPA", ())) and "Accept" in told:
            break
    for message in range(len(feed.trace.messages.t)):
        of = feed.trace.messages
        if feed.trace.kinds[of.kind[message]] == "CPA":
            sender = feed.trace.robots[of.sender[message]]
            own = feed.names.wording(0, sender, sender)
            branch = own.branch
            assert branch[-1] == sender
            values = [value for value, _ in feed.trace.content(message)["assignments"]]
            assert len(values) == len(branch)
            facts = [
                f"{name} = {one}"
                for robot, value in zip(branch, values, strict=True)
                for name, one in zip(own.interfaces[robot], value, strict=True)
            ]
            assert feed.words(message) == f"{sender} says: so far {listed(facts)}"
    assert all("accept its partial assignment" in one for one in told["Accept"])


FACT = re.compile(r"(V\S+) (?:=|cannot be) (-?\d+)")


def test_robots_with_several_variables_are_told_by_those_that_matter() -> None:
    with cases() as each:
        for seed in range(12):
            with each(f"seed {seed}"):
                team = random_complex_team(Random(seed))
                robots = tuple(replace(robot, private=()) for robot in team.robots)  # the rest needs no solver
                assert_facts_are_told(replace(team, robots=robots))


def assert_facts_are_told(team: Team) -> None:
    feed = PageData(Trace.of(record(team, Options(protocol="abt", runtime=Runtime.SIMULATOR, cache=False))))
    of = feed.trace.messages
    for message in range(len(of.t)):
        sender, receiver = (feed.trace.robots[robot[message]] for robot in (of.sender, of.receiver))
        content = feed.trace.content(message)
        values = {**content.get("lhs", {}), (receiver if "lhs" in content else sender): content.get("value", [])}
        facts = {
            (name, str(value))
            for robot, told in values.items()
            for name, value in zip(team[robot].interface, told, strict=bool(told))
            if value is not None
        }
        words = feed.words(message)
        assert " more" not in words
        assert {match.groups() for match in FACT.finditer(words)} == facts, words


def test_names_follow_the_team_through_its_epochs() -> None:
    found = 0
    for seed in range(40):
        team = random_changing_team(Random(seed))
        options = Options(protocol="dynabt", runtime=Runtime.SIMULATOR, cache=False)
        feed = PageData(Trace.of(record(team, options)))
        of = feed.trace.messages
        joined = set(feed.trace.robots) - set(team.order)
        for message in range(len(of.t)):
            sender = feed.trace.robots[of.sender[message]]
            if sender in joined and feed.trace.kinds[of.kind[message]] == "Ok":
                found += 1
                (name,) = feed.names.wording(of.run[message], sender, sender).interfaces[sender]
                assert feed.words(message).startswith(f"{sender} says: {name} = ")
                assert name in feed.names.variables(sender)
        if found:
            break
    assert found


# One by one

ORDER = ("Robot1.1", "Robot2.1")
TWO = Wording("Robot2.1", "Robot1.1", ORDER, {"Robot1.1": ("V", "W"), "Robot2.1": ("V2.1",)}, ORDER)


def test_names_from_a_known_team_are_those_from_its_files() -> None:
    """Also with changes, with other orders, and on a tree."""
    compared = 0
    for seed in range(30):
        random = Random(seed)
        team = random_changing_team(random) if seed % 2 else random_complex_team(random)
        order = random.choice([*Order])
        protocol = "dpop" if seed % 3 == 0 else "abt"
        journal = record(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, cache=False, order=order))
        known, read = JournalSentences(team=team), JournalSentences()
        for entry in (journal.header, *journal.events):
            known.follow(entry)
            read.follow(entry)
            if isinstance(entry, Sent):
                assert known.sentence(entry) == read.sentence(entry)
                compared += 1
    assert compared > 100


def type_with(kind: str, content: Mapping[str, Any]) -> type[Message]:
    """A type of that name with those fields; of several, any."""
    return next(one for one in TYPES if one.__name__ == kind and set(one.__struct_fields__) == {*content})


RARER: list[tuple[str, dict[str, Any], str]] = [
    ("Nogood", {"lhs": {"Robot2.1": [3]}, "value": [1, 2]},
     "as long as V2.1 = 3, V = 1 and W = 2 cannot both hold"),
    ("Nogood", {"lhs": {"Robot2.1": [3]}, "value": [None, 2]}, "as long as V2.1 = 3, W cannot be 2"),
    ("Nogood", {"lhs": {"Robot2.1": [None]}, "value": [1, None]}, "V cannot be 1, whatever the others do"),
    ("Nogood", {"lhs": {}, "value": [None, None]}, "Robot1.1 has no value left, whatever the others do"),
    ("Nogood", {"lhs": {"Robot9.9": [3]}, "value": [1, None]}, "as long as Robot9.9 = 3, V cannot be 1"),
    ("Nogood", {"lhs": {"X": [3, 4]}, "value": [1, None]}, "as long as X[1] = 3 and X[2] = 4, V cannot be 1"),
    ("Ok", {"value": [None]}, "I withdraw from now on"),
    ("AddLink", {}, "tell me V and W from now on"),
    ("NotOk", {"assignments": [], "sc": 1}, "there is no solution"),
    ("Solved", {"solution": {"Robot1.1": [None, None], "Robot2.1": [3]}},
     "a solution is found, and the search is over: Robot1.1 withdraws and V2.1 = 3"),
    ("Placed", {"value": None}, "I withdraw"),
    ("Cost", {"context": {}, "lb": math.inf, "ub": math.inf}, "my subtree has no solution"),
    ("Cost", {"context": {"Robot1.1": [[1, 2], 4]}, "lb": 3, "ub": 3.0},
     "as long as V = 1 and W = 2, my subtree costs 3"),
    ("Cost", {"context": {}, "lb": 2.5, "ub": None}, "my subtree costs at least 2.5"),
    ("Value", {"value": [3], "counter": 2, "threshold": None}, "V2.1 = 3 from now on (change 2)"),
    ("Terminate", {"best": [None, []]}, "the search is over, and there is no solution"),
    ("Terminate", {"context": {}}, "all above you have taken their last values"),
    ("Backtrack", {"best": [None, []]}, "Robot1.1's value leads to no solution: take another one"),
    ("CPA", {"assignments": [[[1, 2], 1]], "bound": None, "least": []},
     "no solution has V = 1 and W = 2: take another value"),
    ("CPAs", {"count": 1, "rows": "", "least": 7, "ceiling": 9},
     "1 partial assignment for Robot1.1 to extend; the best solution so far costs 7"),
    ("Below", {"domains": [], "charges": [], "runs": [], "most": 0}, "nobody is below me"),
    ("UTIL", {"width": 1, "costs": bytes([3, 255, 9])},
     "a piece of my table: 3 costs, from 3 to 9, and 1 infinite"),
    ("UTIL", {"width": 2, "costs": "//8="}, "a piece of my table: 1 cost, and 1 infinite"),
    ("VALUE", {"assignment": []}, "nobody above you has to do with your subtree: take your best value"),
    ("Domain", {"values": [[1], [2], [None]]}, "V2.1 is 1 or 2, or I withdraw"),
    ("Gain", {"broken": 2, "cost": 0}, "my move would save 2 broken constraints"),
    ("Gain", {"broken": 1, "cost": 3}, "my move would save 1 broken constraint and 3 of cost"),
    ("Gain", {"broken": 0, "cost": 0.0}, "my move would save nothing"),
    ("Offer", {"gains": None}, "I have no offer for you"),
    ("Go", {"go": True}, "go: of my neighbours, nobody is to move before us"),
    ("R", {"rows": [[0, math.inf], [1, 2]]},
     "by our 2 functions, one after the other, Robot1.1's values cost 0 and infinity; 1 and 2"),
    ("Proceed", {"separator": []}, "all tables fit: make yours"),
    ("InferCtxt", {"places": {"Robot1.1": 1}},
     "what does your subtree cost at least with Robot1.1's value number 2?"),
    ("InferCtxt", {"places": {}}, "what does your subtree cost at least with any values?"),
    ("CtxtUtil", {"axes": [["Robot1.1", 0, 2]], "costs": [3, 9]},
     "with these values my subtree costs at least 3 to 9, by the values of Robot1.1"),
    ("CtxtUtil", {"axes": [], "costs": [math.inf]},
     "with these values my subtree costs infinity, by the values of nobody"),
]  # fmt: skip


def test_the_rarer_things_that_are_said() -> None:
    with cases() as each:
        for kind, content, words in RARER:
            with each(words):
                assert sentence(kind, content, TWO, type_with(kind, content)) == f"Robot2.1 says: {words}"


def test_long_contents_are_cut() -> None:
    names = [f"R{place}" for place in range(20)]
    told = sentence("Token", {"visited": dict.fromkeys(names, 1)}, TWO, Token)
    assert told.endswith("not all know of R0, R1, R2, R3, R4, R5, R6, R7 and 12 more yet")
    assert len(sentence("Token", {"visited": {f"{place}" * 500: 1 for place in range(9)}}, TWO, Token)) == 1000


def test_a_users_own_type_is_told_by_its_fields() -> None:
    content = {"price": 3, "item": "x" * 100, "many": list(range(50)), "few": [1, 2]}
    told = sentence("Bid", content, TWO, None)
    assert told == f"Robot2.1 says Bid (inform): price = 3, item = {'x' * 59}…, many = 50 entries and few = [1,2]"
    assert sentence("Ok", {"value": [3]}, TWO, None) == "Robot2.1 says Ok (inform): value = [3]"
    assert sentence("Bye", {}, TWO, None) == "Robot2.1 says Bye (inform)"


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.binary(max_size=9),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4) | st.just("Robot1.1"), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(st.sampled_from(TYPES), st.data())
@examples(100)
def test_there_are_words_for_whatever_a_journal_holds(kind: type[Message], data: st.DataObject) -> None:
    content: Mapping[str, Any] = {name: data.draw(anything) for name in kind.__struct_fields__}
    told = sentence(kind.__name__, content, TWO, kind)
    assert told.startswith("Robot2.1 says")
    assert len(told) <= 1000
    assert told.isprintable()
