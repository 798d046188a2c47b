"""What a page is told: the answers, their limits, and messages as FIPA ACL."""

from __future__ import annotations

import json
import zlib
from dataclasses import replace
from typing import Any

import msgspec
import pytest

from robochoc.formats import PREDEFINED
from robochoc.journal.events import AnyEvent, Began, Concluded, Given, Improved, Lost, Refused, Sent, Settled
from robochoc.journal.journal import Header, Journal, read_journal
from robochoc.journal.recorder import JournalRecorder
from robochoc.model.assembly import assemble
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import Constraint, Domain, Variable
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.sniffer import page_data
from robochoc.sniffer.acl import parse
from robochoc.sniffer.columns import NOT_YET
from robochoc.sniffer.export import embedded_answers
from robochoc.sniffer.page_data import (
    DETAILS,
    MOST_EPOCHS,
    MOST_NOTES,
    MOST_ROWS,
    BadRequestError,
    PageData,
    verdict_of,
)
from robochoc.sniffer.trace import Trace
from tests.support.recorded_journals import feed_of, recorded

HOSTILE = '</script>"); DROP\n\x1b[2J\N{RIGHT-TO-LEFT OVERRIDE}'


def told(answer: bytes) -> Any:  # noqa: ANN401 - JSON
    return json.loads(answer)


def of_strangers(
    *contents: dict[str, Any], protocol: str = "a-protocol-that-is-not-there", kind: str = "Bid"
) -> PageData:
    events: list[AnyEvent] = [
        Began(t=0, protocol=protocol),
        *(Sent(t=0, sender="a", receiver=HOSTILE, type=kind, content=one, bytes=1, clock=7) for one in contents),
        Settled(t=1, robot="a", clock=7, checks=7),
    ]
    header = Header(team=HOSTILE, protocol=protocol, runtime="simulator", seed=0)
    return PageData(Trace.of(Journal(header, tuple(events), None)))


def test_about_says_what_was_run_and_how_it_ended() -> None:
    about = told(feed_of("abt").about())
    journal = recorded("abt")
    assert {key: about[key] for key in ("format", "generation", "team", "protocol", "runtime", "seed", "live")} == {
        "format": 1, "generation": 0, "team": "queens3d-3", "protocol": "abt", "runtime": "simulator", "seed": 0,
        "live": False,
    }  # fmt: skip
    assert about["messages"] == sum(isinstance(event, Sent) for event in journal.events)
    assert about["robots"][0] == {"name": "Robot1.1", "variables": ["V1.1"]}
    assert [robot["name"] for robot in about["robots"]] == [f"Robot{i}.{j}" for i in (1, 2, 3) for j in (1, 2, 3)]
    assert {kind["name"]: kind["performative"] for kind in about["kinds"]} == {
        "Ok": "inform", "Nogood": "disconfirm", "AddLink": "subscribe",
    }  # fmt: skip
    assert about["runs"] == [
        {"number": 0, "protocol": "ABT", "epoch": None, "opened_by": None, "message": 0, "step": 0}
    ]
    assert (about["over"], about["damage"], about["replay"]) == (True, None, "")
    assert about["verdict"].startswith("No solution, as Robot")
    assert about["outcome"]["verdict"] == "no-solution"


def test_decisions_are_those_of_the_journal() -> None:
    feed = feed_of("abt")
    count = told(feed.about())["decisions"]
    decisions = told(feed.decisions(0, count))
    assert len(decisions) == count
    assert decisions[0] == [0, {"V1.1": 1}]


def test_rows_that_are_not_there_or_too_many_are_refused() -> None:
    feed = feed_of("abt")
    for answer in (feed.columns, feed.steps, feed.decisions):
        for first, end in ((0, 1 << 40), (5, 4), (-1, 3), (1 << 40, 1 << 41)):
            with pytest.raises(BadRequestError, match=r"rows .* do not exist"):
                answer(first, end)
    events = (Settled(t=0, robot="a", clock=0, checks=0) for _ in range(MOST_ROWS + 1))
    large = PageData(Trace.of(Journal(Header(team="", protocol="", runtime="", seed=0), tuple(events), None)))
    large.steps(1, MOST_ROWS + 1)
    with pytest.raises(BadRequestError, match="too many for one request"):
        large.steps(0, MOST_ROWS + 1)


def test_details_come_in_chunks() -> None:
    feed = of_strangers(*({"n": number} for number in range(DETAILS + 3)))
    assert len(told(feed.details(0))) == DETAILS
    assert [one["content"] for one in told(feed.details(1))] == [{"n": DETAILS + more} for more in range(3)]
    for chunk in (2, -1, 1 << 60):
        with pytest.raises(BadRequestError, match=r"chunk .* does not exist"):
            feed.details(chunk)


def test_notes_are_bounded_and_losses_are_not_crowded_out() -> None:
    events: list[AnyEvent] = [Lost(t=0, robot="a", why=f"{number}") for number in range(MOST_NOTES + 5)]
    events += [Improved(t=0, cost=number, assignment={}) for number in range(MOST_NOTES + 5)]
    feed = PageData(Trace.of(Journal(Header(team="", protocol="", runtime="", seed=0), tuple(events), None)))
    notes = told(feed.about())["notes"]
    assert len(notes) == 2 * MOST_NOTES
    assert notes[MOST_NOTES - 1]["text"] == f"a was lost: {MOST_NOTES + 4}"
    assert notes[-1]["text"] == f"the best cost so far is {MOST_NOTES + 4:,}"


def test_a_protocol_that_is_not_installed_has_details_all_the_same() -> None:
    feed = of_strangers({"price": 3, "raw": b"\x00", "far": float("inf"), "by": {(1, 2): 3}, "map": {"map": 1}})
    (detail,) = told(feed.details(0))
    assert detail["content"] == {
        "price": 3, "raw": {"base64": "AA=="}, "far": {"float": "inf"}, "by": {"map": [[[1, 2], 3]]},
        "map": {"map": [["map", 1]]},
    }  # fmt: skip
    acl = parse(detail["acl"])
    assert acl.receiver[0].local == HOSTILE
    assert (acl.protocol, acl.conversation_id, acl.reply_with) == ("a-protocol-that-is-not-there", "run-1", "a/1")
    assert json.loads(acl.content or "") == ["Bid", detail["content"]]
    assert detail["words"].startswith("a says Bid (inform): price = 3, ")
    assert detail["fields"]["X-clock"] == "7"


def test_without_files_robots_are_known_by_what_they_decide() -> None:
    events = tuple(event for event in recorded("abt").events if not isinstance(event, Given))
    feed = PageData(Trace.of(Journal(recorded("abt").header, events, None)))
    assert feed.words(0) == "Robot1.1 says: V1.1 = 1 from now on"
    about = told(feed.about())
    assert about["robots"][0] == {"name": "Robot1.1", "variables": ["V1.1"]}
    assert about["replay"] == "the journal does not contain the robots' problems"
    unknown = of_strangers({"value": [3]}, protocol="abt", kind="Ok")
    assert unknown.words(0) == "a says: a = 3 from now on"


def test_what_the_protocol_does_not_know_is_told_as_it_stands() -> None:
    for feed in (
        of_strangers({"price": 3}, protocol="abt"),
        of_strangers({"value": "not a value"}, protocol="abt", kind="Ok"),
        of_strangers({}, protocol="abt", kind="Ok"),
    ):
        (detail,) = told(feed.details(0))
        assert parse(detail["acl"]).protocol == "abt"
        assert detail["words"].startswith("a says")


def test_a_nameless_robot_breaks_nothing() -> None:
    events = (Sent(t=0, sender="", receiver="", type="Ok", content={"value": [1]}, bytes=1, clock=-3),)
    header = Header(team="", protocol="abt", runtime="", seed=0)
    feed = PageData(Trace.of(Journal(header, events, None)))
    assert parse(told(feed.details(0))[0]["acl"]).sender is not None
    assert feed.trace.messages.taken[0] == NOT_YET


def test_a_page_without_a_server_gets_all_answers_at_once() -> None:
    feed, journal = feed_of("abt"), recorded("abt")
    answers = {name: zlib.decompress(content) for name, content in embedded_answers(feed, journal).items()}
    count, steps = len(feed.trace.messages.t), len(feed.trace.steps.t)
    assert answers["columns"] == feed.columns(0, count)
    assert answers["steps"] == feed.steps(0, steps)
    assert json.loads(answers["about"])["messages"] == count
    assert answers["details:0"] == feed.details(0)
    states = [name for name in answers if name.startswith("states:")]
    robots = list(feed.trace.steps.robot)
    assert len(states) == sum(-(-robots.count(robot) // 64) for robot in set(robots))
    assert not [name for name in embedded_answers(feed) if name.startswith("states:")]
    assert msgspec.json.decode(answers["states:0:0"])


def test_the_end_is_told_as_the_report_tells_it() -> None:
    header = Header(team="T", protocol="abt", runtime="simulator", seed=0)
    given = Given(t=0, order=("R1", "R2", "R3"), robots={})

    def ended(**ending: Any) -> str:  # noqa: ANN401 - fields of an outcome
        outcome = replace(Outcome(Verdict.SOLUTION, team="T", protocol="abt", runtime="simulator", seed=0), **ending)
        return verdict_of(Trace.of(Journal(header, (Began(t=0, protocol="ABT"), given), outcome, None)))

    assert ended(cost=0) == "A solution."
    assert ended(verdict=Verdict.OPTIMAL, cost=7) == "The best solution, of cost 7."
    assert ended(lost=("R2",), withdrawn=("R2",)) == "A solution; lost: R2."
    one = "2 of 3 fly (not proven to be the best): no solution for all, as R1 has ruled everything out; withdrawn: R2."
    assert ended(witness="R1", withdrawn=("R2",)) == one
    assert ended(verdict=Verdict.NO_SOLUTION, witness="R1") == "No solution, as R1 has ruled everything out."
    assert ended(verdict=Verdict.OPTIMAL, witness="R1", cost=7) == "The best solution, of cost 7, as R1 has concluded."
    gave_up = ended(verdict=Verdict.UNKNOWN, witness="R1", reason="R1 gave up, as its protocol has it")
    assert gave_up == "No verdict: R1 gave up, as its protocol has it."
    best = ended(verdict=Verdict.OPTIMAL, withdrawn=("R1", "R2"), lost=("R1",))
    assert best == "1 of 3 fly (proven best; 1 lost): no solution for all; withdrawn: R2; lost: R1."
    epochs = [EpochOutcome(verdict, robots=("R1",)) for verdict in (Verdict.SOLUTION, Verdict.NO_SOLUTION)]
    epochs += [EpochOutcome(Verdict.UNKNOWN, robots=("R1",), lost=("R2",))]
    assert ended(epochs=(epochs[0],)) == "A solution."
    assert ended(epochs=tuple(epochs)) == "3 epochs: a solution, no solution, R2 lost. The last: A solution."
    many = ended(epochs=(epochs[0],) * 1000)
    assert many == f"1,000 epochs: {', '.join(['a solution'] * MOST_EPOCHS)} and 992 more. The last: A solution."


def test_notes_stand_at_the_steps_that_they_belong_to() -> None:
    journal = recorded("abt")
    concluded = [event.robot for event in journal.events if isinstance(event, Concluded)]
    assert concluded
    trace = Trace.of(journal)
    notes = [note for note in json.loads(PageData(trace).about())["notes"] if note["kind"] == "concluded"]
    assert [(note["robot"], note["text"]) for note in notes] == [(who, "concluded: no solution") for who in concluded]
    for note in notes:
        assert trace.robots[trace.steps.robot[note["step"]]] == note["robot"]
        assert note["step"] == max(n for n, r in enumerate(trace.steps.robot) if trace.robots[r] == note["robot"])
    half = len(journal.events) // 2
    lost = Lost(t=journal.events[half].t, robot="Robot1.1", why="hit")
    refused = Refused(t=lost.t, who="X", what="joining", why="unknown")
    trace = Trace.of(replace(journal, events=(*journal.events[:half], lost, refused, *journal.events[half:])))
    notes = [note for note in json.loads(PageData(trace).about())["notes"] if note["kind"] in {"lost", "refused"}]
    assert [note["kind"] for note in notes] == ["lost", "refused"]
    assert all(0 < note["step"] < len(trace.steps.t) for note in notes)


# Symbolic domains


COLOURS = Domain("colours", (range(2),), ("red", "green"))


def test_decisions_and_words_have_the_names_of_symbols() -> None:
    scope = ("x", "y")
    team = assemble(
        "colours",
        {"a": [Variable("x", COLOURS)], "b": [Variable("y", COLOURS)]},
        [Constraint("C", PREDEFINED["ne"], scope, scope)],
    )
    recorder = JournalRecorder(Header(team=team.name, protocol="abt", runtime="simulator", seed=0))
    recorder.outcome = solve(team, Options(protocol="abt", runtime=Runtime.SIMULATOR), observer=recorder)
    data = PageData(Trace.of(read_journal(recorder.content())))
    decided = [values for _, values in json.loads(data.decisions(0, len(data.trace.decisions)))]
    assert {"x": "red"} in decided
    assert {"y": "green"} in decided
    assert b"x = red" in data.details(0)


@pytest.mark.parametrize("most", [3, 100_000])
@pytest.mark.parametrize("query", ["cannot", "robot1.1 robot", "nogood", "nowhere", '{"value":[2]}'])
def test_a_search_in_parts_finds_the_messages_whose_details_contain_the_text(
    monkeypatch: pytest.MonkeyPatch, query: str, most: int
) -> None:
    monkeypatch.setattr(page_data, "_SEARCHED_AT_ONCE", 100)
    monkeypatch.setattr(page_data, "_MOST_SEARCHED", most)
    data = feed_of("abt")
    trace, count = data.trace, len(data.trace.messages.t)
    hits: list[int] = []
    first, parts = 0, 0
    while first < count:
        answer = told(data.search(query, first, count, within_s=0))
        hits += answer["hits"]
        assert first < answer["to"] <= count
        first, parts = answer["to"], parts + 1
    assert parts == -(-count // 100)
    kinds = {kind["name"]: kind["performative"] for kind in told(data.about())["kinds"]}
    expected = []
    for message in range(count):
        detail, kind = data.detail(message), trace.kinds[trace.messages.kind[message]]
        sender, receiver = (
            trace.robots[column[message]] for column in (trace.messages.sender, trace.messages.receiver)
        )
        content = json.dumps(detail["content"], separators=(",", ":"))
        text = f"{detail['words']}\n{sender} {receiver}\n{kind} {kinds[kind]}\n{content}"
        expected += [message] if query in text.lower() else []
    assert hits == expected
    assert bool(hits) == (query != "nowhere")
