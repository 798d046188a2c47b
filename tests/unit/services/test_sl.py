"""SL0: symbolic expressions are read as they are written, and the Directory Facilitator answers as FIPA00023 has it."""

from __future__ import annotations

import contextlib
import doctest

import pytest
import sexpdata
from hypothesis import given
from hypothesis import strategies as st

import robochoc.services.sl
from robochoc.protocols.acts import Performative
from robochoc.services.descriptions import AgentDescription, RequestRefusedError, ServiceDescription
from robochoc.services.directory import Directory
from robochoc.services.facilitator import handle
from robochoc.services.identifier import AgentIdentifier, expression_of, identifier_of, identifier_on
from robochoc.services.sl import (
    REQUEST_CAPS,
    DirectoryFunction,
    described,
    description_of,
    descriptions_in,
    df_on,
    request,
)
from robochoc.services.symbolic import (
    Caps,
    Expression,
    List,
    String,
    SymbolicExpressionError,
    Word,
    name,
    read,
    text_form,
)
from tests.support.cases import cases
from tests.support.examples import examples

CAPS = Caps(10_000, 100, 10)
DF = df_on("host:7447/robochoc")
ROBOT = "Robot3.1@host:7447/robochoc"

TEXTS = st.text(max_size=8)
WORDS = st.text(st.characters(exclude_characters='()"', min_codepoint=0x21), min_size=1, max_size=8).map(Word)
EXPRESSIONS: st.SearchStrategy[Expression] = st.recursive(
    st.one_of(TEXTS.map(String), WORDS, TEXTS.map(name)),
    lambda inner: st.lists(inner, max_size=4).map(lambda items: List(tuple(items))),
    max_leaves=20,
)
NAMES = st.lists(TEXTS, max_size=2).map(tuple)
SERVICES = st.builds(
    ServiceDescription,
    TEXTS,
    TEXTS,
    TEXTS,
    NAMES,
    NAMES,
    NAMES,
    st.lists(st.tuples(TEXTS, TEXTS), max_size=2).map(tuple),
)
LEASES = st.none() | st.integers(1, 99 * 86_400_000).map(lambda ms: ms / 1000)


@st.composite
def descriptions(draw: st.DrawFn) -> AgentDescription:
    called = draw(TEXTS)
    services = tuple(draw(st.lists(SERVICES, max_size=2)))
    addresses = draw(NAMES) if called else ()
    return AgentDescription(called, services, draw(NAMES), draw(NAMES), draw(NAMES), draw(LEASES), addresses)


@given(EXPRESSIONS)
def test_what_is_written_is_read(expression: Expression) -> None:
    assert read(text_form(expression), Caps(10_000, 1000, 50)) == expression


@given(EXPRESSIONS)
def test_an_independent_reader_finds_the_same_strings_and_lists(expression: Expression) -> None:
    """Words that we would not write, such as numbers, are left out: sexpdata has its own mind about them."""
    assert sexpdata.loads(text_form(quoted(expression)), nil=None, true=None) == foreign(quoted(expression))


def quoted(expression: Expression) -> Expression:
    match expression:
        case List(items):
            return List(tuple(map(quoted, items)))
        case other:
            return String(other.text)


def foreign(expression: Expression) -> object:
    return list(map(foreign, expression.items)) if isinstance(expression, List) else expression.text


BAD_EXPRESSIONS: list[tuple[str, str, int]] = [
    ("", "no expression", 0),
    ("  ", "no expression", 2),
    ("(a (b)", "ends before", 6),
    ("a)", "after the end", 1),
    (")", "closes nothing", 0),
    ("(a) b", "after the end", 4),
    ('(a "b', "never closed", 3),
    ('("a\\"', "never closed", 1),
    ('#9"abc', "the text ends before", 0),
    ('#1"é', "complete characters", 0),
    ("(" * 11, "deeper than 10", 10),
    ("(" + "a " * 100, "more than 100", 199),
    ("x" * 10_001, "too many", 10_000),
]


def test_bad_expressions_are_told_with_their_place() -> None:
    with cases() as each:
        for text, message, at in BAD_EXPRESSIONS:
            with each(f"{text:.30}"):
                with pytest.raises(SymbolicExpressionError, match=message) as caught:
                    read(text, CAPS)
                assert caught.value.at == at


def test_fipa_strings_that_tell_their_size_are_read() -> None:
    assert read('(a #4"("é b)', CAPS) == List((Word("a"), String('("é'), Word("b")))


def test_backslashes_before_other_characters_stand_for_themselves() -> None:
    assert read(r'"C:\new \"x\" \\"', CAPS) == String(r'C:\new "x" ' + "\\")


@given(st.text(alphabet='()":#\\ ab0\n', max_size=40))
@examples(300)
def test_any_text_is_read_or_refused(text: str) -> None:
    with contextlib.suppress(SymbolicExpressionError):
        expression = read(text, CAPS)
        assert read(text_form(expression), Caps(200, 100, 10)) == expression


def test_millions_of_escapes_end() -> None:
    """They took time that grew with the square of their number."""
    many = 2_000_000
    assert read('"' + '\\"' * many + '"', Caps(3 * many, 1, 1)) == String('"' * many)
    with pytest.raises(SymbolicExpressionError, match="never closed"):
        read('"' + '\\"' * many, Caps(3 * many, 1, 1))


def test_words_that_begin_with_a_digit_are_written_as_strings() -> None:
    assert text_form(name("7")) == '"7"'
    assert text_form(name("Robot3.1@192.168.1.14:7447/robochoc")) == "Robot3.1@192.168.1.14:7447/robochoc"
    with pytest.raises(ValueError, match="not a valid word"):
        text_form(Word("a b"))


@given(st.recursive(st.builds(AgentIdentifier, TEXTS.filter(bool), NAMES), lambda inner: st.builds(
    AgentIdentifier, TEXTS.filter(bool), NAMES, st.lists(inner, max_size=2).map(tuple)), max_leaves=4))  # fmt: skip
def test_identifiers_are_read_as_they_are_written(identifier: AgentIdentifier) -> None:
    assert identifier_of(read(text_form(expression_of(identifier)), Caps(10_000, 1000, 50))) == identifier


def test_an_identifier_has_a_local_name_and_a_platform() -> None:
    identifier = identifier_on("host:7447/robochoc", "a@b")
    assert (identifier.local, identifier.platform) == ("a@b", "host:7447/robochoc")
    assert (AgentIdentifier("df").local, AgentIdentifier("df").platform) == ("df", "")
    for platform, local in (("p@q", "a"), ("", "a"), ("p", "")):
        with pytest.raises(ValueError, match="need a name"):
            identifier_on(platform, local)


@given(descriptions())
def test_descriptions_are_read_as_they_are_written(description: AgentDescription) -> None:
    assert description_of(read(text_form(described(description)), REQUEST_CAPS)) == description


def test_a_lease_is_written_in_days_hours_minutes_and_seconds() -> None:
    description = AgentDescription("r", lease_s=(((1 * 24 + 2) * 60) + 3) * 60 + 4.5)
    text = text_form(described(description))
    assert ":lease-time +00000001T020304500" in text
    assert description_of(read(text, REQUEST_CAPS)) == description


ABT = AgentDescription(ROBOT, (ServiceDescription("abt", "robochoc", protocols=("abt",)),), ("abt",), lease_s=30.5)


def test_register_is_done_and_searches_find_it() -> None:
    directory = Directory()
    registered = handle(directory, ROBOT, request(DF, DirectoryFunction.REGISTER, ABT), 0)
    assert registered[0] is Performative.INFORM
    assert registered[1] == (
        f"((done (action (agent-identifier :name {DF.name}) (register (df-agent-description"
        f" :name (agent-identifier :name {ROBOT})"
        " :services (set (service-description :name abt :type robochoc :protocols (set abt)))"
        " :protocols (set abt) :lease-time +00000000T000030500)))))"
    )
    found = handle(directory, "x@p", request(DF, DirectoryFunction.SEARCH, AgentDescription(protocols=("abt",))), 1)
    assert found[0] is Performative.INFORM
    assert descriptions_in(found[1]) == (ABT,)
    later = handle(directory, "x@p", request(DF, DirectoryFunction.SEARCH, AgentDescription(protocols=("abt",))), 31)
    assert descriptions_in(later[1]) == ()


def test_modify_and_deregister() -> None:
    directory = Directory()
    for function, description, performative in (
        (DirectoryFunction.MODIFY, ABT, Performative.FAILURE),
        (DirectoryFunction.REGISTER, ABT, Performative.INFORM),
        (DirectoryFunction.REGISTER, ABT, Performative.FAILURE),
        (DirectoryFunction.MODIFY, AgentDescription(ROBOT), Performative.INFORM),
        (DirectoryFunction.DEREGISTER, AgentDescription(ROBOT), Performative.INFORM),
        (DirectoryFunction.DEREGISTER, AgentDescription(ROBOT), Performative.FAILURE),
    ):
        assert handle(directory, ROBOT, request(DF, function, description), 0)[0] is performative
    assert not len(directory)


def test_max_results_limits_a_search() -> None:
    directory = Directory()
    for robot in "cab":
        handle(directory, robot, request(DF, DirectoryFunction.REGISTER, AgentDescription(robot)), 0)
    for wanted, names in ((2, ["a", "b"]), (0, []), (-1, ["a", "b", "c"]), (None, ["a", "b", "c"])):
        answer = handle(directory, "x", request(DF, DirectoryFunction.SEARCH, AgentDescription(), wanted), 0)[1]
        assert [one.name for one in descriptions_in(answer)] == names


NAMELESS = "(set (service-description :name a :type b :properties (set (property :name x))))"
SELF = f"(df-agent-description :name (agent-identifier :name {ROBOT}))"


REFUSED: list[tuple[str, str, str]] = [
    (f"(modify {SELF})", "failure", "not-registered"),
    ("(register (df-agent-description :name (agent-identifier :name other@p)))", "refuse", "unauthorised"),
    ("(deregister (df-agent-description :name (agent-identifier :name other@p)))", "refuse", "unauthorised"),
    ("(register)", "refuse", "(missing-argument df-agent-description)"),
    (f"(register {SELF} {SELF})", "refuse", "(unexpected-argument register)"),
    ("(register (df-agent-description))", "refuse", "(missing-parameter df-agent-description name)"),
    ("(deregister (df-agent-description))", "refuse", "(missing-parameter df-agent-description name)"),
    (
        f"(register {SELF[:-1]} :services (set (service-description :name a))))",
        "refuse",
        "(missing-parameter service-description type)",
    ),
    (f"(register {SELF[:-1]} :wings 2))", "refuse", "(unexpected-parameter df-agent-description wings)"),
    (
        f"(register {SELF[:-1]} :lease-time 20260101T000000000Z))",
        "refuse",
        "(unrecognised-parameter-value df-agent-description lease-time)",
    ),
    (
        f"(search {SELF} (search-constraints :max-results many))",
        "refuse",
        "(unrecognised-parameter-value search-constraints max-results)",
    ),
    ("(fly high)", "refuse", "(unsupported-function fly)"),
    (
        f"(register {SELF[:-1]} :services {NAMELESS}))",
        "refuse",
        "(missing-parameter property value)",
    ),
]


def test_what_cannot_be_done_is_refused_or_fails() -> None:
    with cases() as each:
        for act, performative, reason in REFUSED:
            with each(act):
                action = f"(action (agent-identifier :name {DF.name}) {act})"
                directory = Directory()
                assert handle(directory, ROBOT, f"({action})", 0) == (performative, f"({action} {reason})")
                assert not len(directory)


def test_an_action_of_somebody_else_is_refused() -> None:
    action = f"(action (agent-identifier :name ams@p) (register {SELF}))"
    answer = (Performative.REFUSE, f"({action} (unrecognised-parameter-value action actor))")
    assert handle(Directory(), ROBOT, f"({action})", 0) == answer


NO_REQUESTS: list[str] = [
    "",
    "hello",
    "()",
    "((action))",
    "((action df (register)))",
    f"((done (action (agent-identifier :name {DF.name}) (register {SELF}))))",
    f"((action (agent-identifier :name {DF.name}) register))",
    f"((action (agent-identifier) (register {SELF})))",
    f"((action (agent-identifier :name {DF.name}) (register (car))))",
    f"((action (agent-identifier :name {DF.name}) (register (df-agent-description :services x))))",
    f"((action (agent-identifier :name {DF.name}) (register {SELF})) (and more))",
    f"((action (agent-identifier :name {DF.name} :name a) (register {SELF})))",
    f"((action (agent-identifier :name {DF.name} name) (register {SELF})))",
    f"((action (agent-identifier :name {DF.name} :name) (register {SELF})))",
    f"((action (agent-identifier :name {DF.name} :wings 2) (register {SELF})))",
    "(" * 1000,
    "(" + "a" * (1 << 18) + ")",
]


def test_what_is_no_request_is_not_understood() -> None:
    with cases() as each:
        for content in NO_REQUESTS:
            with each(f"{content:.120}"):
                directory = Directory()
                performative, answer = handle(directory, ROBOT, content, 0)
                assert performative is Performative.NOT_UNDERSTOOD
                assert answer.startswith("((unsupported-value ")
                assert len(answer) < 300
                assert not len(directory)


@given(st.text(alphabet='()":+ arf0\n', max_size=60))
def test_any_content_has_an_answer(act: str) -> None:
    handle(Directory(), ROBOT, f"((action (agent-identifier :name {DF.name}) {act}))", 0)


def test_what_is_no_result_is_no_answer_to_a_search() -> None:
    for content in ("((done x))", "((result x))", "((result x (list)))"):
        with pytest.raises(SymbolicExpressionError):
            descriptions_in(content)
    with pytest.raises(RequestRefusedError, match="unexpected-parameter"):
        descriptions_in("((result x (set (df-agent-description :wings 2))))")


def test_the_examples_run() -> None:
    assert doctest.testmod(robochoc.services.sl).failed == 0
