"""What is seen of a run while its journal grows: values, messages in words, costs; torn and hostile journals."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from random import Random

import msgspec
import pytest

from robochoc.app.runs import live
from robochoc.app.runs.live import LAST, Live, LiveReader
from robochoc.journal.events import AnyEvent, Began, Bounded, Decided, Given, Heard, Sent
from robochoc.journal.journal import Header, Journal, JournalRecorder, lines_of
from robochoc.model.costs import normalized
from robochoc.run import Options, Runtime
from robochoc.run.recording import objective_to_record
from robochoc.verification.objective import Objective
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.recorded_journals import record

TEAM = random_cost_team(Random(5))


def _code(_: str, code: int) -> int:
    return code


def _journal(protocol: str = "syncbb") -> Journal:
    return record(TEAM, Options(protocol=protocol, runtime=Runtime.SIMULATOR, cache=False, bounds=True))


def _reader(file: Path, facts: Live, *, weighed: bool = True) -> LiveReader:
    objective = objective_to_record(TEAM, Options())
    assert objective is not None
    return LiveReader(file, facts, _code, objective() if weighed else None, lambda name, code: f"<{name}:{code}>")


def _catch_up(file: Path, facts: Live) -> None:
    with closing(_reader(file, facts)) as reader:
        while reader.advance():
            pass


def _text(journal: Journal) -> bytes:
    return b"".join(lines_of(journal))


def test_that_a_growing_journal_is_followed_line_by_line(tmp_path: Path) -> None:
    file, facts = tmp_path / "run.journal", Live()
    journal = _journal()
    reader = _reader(file, facts)
    assert not reader.advance()
    written = _text(journal)
    chance, place = Random(1), 0
    while place < len(written):
        step = chance.randint(1, 400)
        with file.open("ab") as growing:
            growing.write(written[place : place + step])  # mostly torn in the middle of a line
        place += step
        reader.advance()
    sent = [event for event in journal.events if isinstance(event, Sent)]
    assert facts.messages == len(sent) > LAST
    assert journal.outcome is not None
    assert {name: value for own in facts.values.values() for name, value in own.items()} == journal.outcome.assignment
    costs = [cost for _, cost in facts.costs]
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] == facts.bound == journal.outcome.cost
    last = sent[-1]
    assert (facts.last_messages[0].sender, facts.last_messages[0].receiver, facts.last_messages[0].kind) == (
        last.sender,
        last.receiver,
        last.type,
    )
    assert len(facts.last_messages) == LAST
    reader.close()


def test_that_values_are_called_as_the_user_calls_them(tmp_path: Path) -> None:
    file, facts = tmp_path / "run.journal", Live()
    file.write_bytes(_text(_journal("adopt")))
    _catch_up(file, facts)
    assert any("= <X" in said.words for said in facts.last_messages)
    assert not any(said.words.startswith(said.sender) for said in facts.last_messages)


HEADER = Header(team="t", protocol="syncbb", runtime="simulator", seed=0)
SENT = Sent(t=1, sender="A", receiver="B", type="Path", content={}, bytes=1, clock=0)
HOSTILE: list[AnyEvent] = [
    Began(t=0, protocol="no such protocol"),
    Began(t=0, protocol="SyncBB"),
    Given(t=0, order=("A", "A"), robots={"A": "<instance/>"}),
    SENT,
    msgspec.structs.replace(SENT, sender="<img src=x>", type="\x1b[2J", content={"a": [[[[1e308]]]] * 9_999}),
    msgspec.structs.replace(SENT, content={"assignments": "none", "best": -1}),
    Decided(t=1, robot="nobody", assignment={"x": 2**62}, clock=0),
    Decided(t=1, robot="RX00", assignment={"nothing": -(2**62)}, clock=0),
    Heard(t=1, robot="nobody", cost=float("-inf"), values={}),
    Heard(t=1, robot="A", cost=float("nan"), values={"A": (None,)}),
    Heard(t=1, robot="A", cost=2**63, values={}),
    Bounded(t=1, robot="nobody", bound=5),
    Bounded(t=1, robot="X00", bound=float("inf")),
]


@looped("order", range(5))
def test_that_hostile_records_are_survived(tmp_path: Path, order: int) -> None:
    file, facts = tmp_path / "run.journal", Live()
    recorder = JournalRecorder(HEADER)
    for event in Random(order).sample(HOSTILE, len(HOSTILE)):
        recorder(event)
    file.write_bytes(recorder.content())
    _catch_up(file, facts)
    assert facts.messages == 3
    assert all(len(said.words) <= 300 and said.words.isprintable() for said in facts.last_messages)
    assert "nobody" not in facts.values
    assert facts.bound is None


@looped("content", [b"", b"no journal", b"\x89RJL\r\n\x1a\nxxxx", b'{"event":"Journal"}\n', b"{\n"])
def test_that_what_is_no_journal_tells_nothing(tmp_path: Path, content: bytes) -> None:
    file, facts = tmp_path / "run.journal", Live()
    file.write_bytes(content)
    reader = _reader(file, facts)
    assert not reader.advance()
    reader.close()
    assert facts == Live()


def test_that_a_damaged_journal_is_read_up_to_there(tmp_path: Path) -> None:
    file, facts = tmp_path / "run.journal", Live()
    lines = _text(_journal()).splitlines(keepends=True)
    file.write_bytes(b"".join(lines[:40]) + b'{"event":"Sent"}\n' + b"".join(lines[40:]))
    _catch_up(file, facts)
    assert facts.messages == sum(b'"event":"Sent"' in line for line in lines[:40])


def test_that_what_is_kept_does_not_grow_with_what_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, facts = tmp_path / "run.journal", Live()
    recorder = JournalRecorder(HEADER)
    for number in range(40_000):
        recorder(msgspec.structs.replace(SENT, t=number))
    file.write_bytes(recorder.content())
    reader = _reader(file, facts)
    monkeypatch.setattr(live, "READ_S", 0.0)
    assert not reader.advance()
    monkeypatch.undo()
    while reader.advance():
        assert len(facts.last_messages) <= LAST
        assert len(facts.recent) <= 1
    reader.close()
    assert facts.messages == 40_000


def test_that_costs_are_those_of_the_objective(tmp_path: Path) -> None:
    file, facts = tmp_path / "run.journal", Live()
    journal = _journal("dsa")
    file.write_bytes(_text(journal))
    _catch_up(file, facts)
    weighed = Objective(normalized(TEAM))
    seen = []
    for event in journal.events:
        if isinstance(event, Decided):
            weighed.change({event.robot: event.assignment})
            seen.append(weighed.cost)
    assert facts.costs
    assert facts.costs[-1][1] == weighed.in_user_units(min(seen))


def _written(file: Path, *events: AnyEvent) -> Path:
    recorder = JournalRecorder(HEADER)
    for event in events:
        recorder(event)
    file.write_bytes(recorder.content())
    return file


def test_that_costs_of_a_run_before_do_not_count(tmp_path: Path) -> None:
    facts = Live()
    began = Began(t=0, protocol="SyncBB", minimises=True)
    dear, cheap = Heard(t=1, robot="X00", cost=7, values={}), Heard(t=1, robot="X00", cost=2, values={})
    bound = Bounded(t=1, robot=TEAM.order[0], bound=1)
    _catch_up(_written(tmp_path / "j", began, cheap, bound, began, dear), facts)
    assert [cost for _, cost in facts.costs] == [7]
    assert facts.bound is None


def test_that_what_was_decided_in_a_run_before_is_no_answer_of_this_one(tmp_path: Path) -> None:
    facts = Live()
    began = Began(t=0, protocol="SyncBB", minimises=True)
    decided = [event for event in _journal("dsa").events if isinstance(event, Decided)]
    first = {event.robot: event for event in reversed(decided)}
    _catch_up(_written(tmp_path / "j", began, *first.values()), facts)
    assert facts.costs  # together they are one
    last = TEAM.order[-1]
    most = [event for robot, event in first.items() if robot != last]
    _catch_up(_written(tmp_path / "j", began, *first.values(), began, *most), facts)
    assert facts.costs == []


def test_that_only_runs_that_minimise_are_weighed(tmp_path: Path) -> None:
    facts = Live()
    heard = Heard(t=1, robot="X00", cost=7, values={})
    _catch_up(_written(tmp_path / "j", Began(t=0, protocol="ABT"), heard), facts)
    assert facts.costs == []


def test_that_costs_and_the_bound_are_exact(tmp_path: Path) -> None:
    facts = Live()
    began = Began(t=0, protocol="SyncBB", minimises=True)
    least, most = 9_007_199_254_740_001, 9_007_199_254_740_991
    events = began, Heard(t=1, robot="X00", cost=most, values={}), Bounded(t=1, robot=TEAM.order[0], bound=least)
    _catch_up(_written(tmp_path / "j", *events), facts)
    assert [repr(facts.costs[-1][1]), repr(facts.bound)] == [str(most), str(least)]
