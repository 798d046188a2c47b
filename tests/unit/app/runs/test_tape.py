"""The conversation of a run that is over: its moments, how it is read, and how it is played back."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from random import Random
from typing import get_args

import msgspec
import pytest

from robochoc.app.runs.player import LARGE_S, LEAST_S, MOST_S, Frames, Player
from robochoc.app.runs.tape import MOST_MOMENTS, WORDS_SAVED, Tape, in_words, recorded
from robochoc.app.texts import catalogue, say
from robochoc.journal.entries import JournalEntry, JournalError
from robochoc.journal.events import Began, Decided, Sent
from robochoc.journal.journal import Header, JournalRecorder
from robochoc.protocols.optimization.sfb import SFB
from robochoc.run import Options, Runtime
from robochoc.run.options import Withdrawal
from robochoc.sniffer.growing_file import NoFileError
from robochoc.sniffer.sentences import JournalSentences
from tests.support.cases import looped
from tests.support.recorded_journals import record
from tests.support.small_teams import triangle

HEADER = Header(team="t", protocol="syncbb", runtime="processes", seed=0)
SENT = Sent(t=0, sender="A", receiver="B", type="Hello", content={"number": 0}, bytes=1, clock=0)
ROBOTS = ["A", "B", "C"]


def _tape(robots: list[str] = ROBOTS) -> Tape:
    return Tape(robots, lambda _, code: code, lambda _, code: str(code))


def _said(number: int, t: float | None = None, sender: str = "A", receiver: str = "B") -> Sent:
    time = float(number if t is None else t)
    content = {"number": number}
    return msgspec.structs.replace(SENT, t=time, content=content, sender=sender, receiver=receiver)


def _decided(robot: str, value: int, t: float = 0) -> Decided:
    return Decided(t=t, robot=robot, assignment={f"{robot}.d": value}, clock=0)


def _taken(*entries: JournalEntry) -> Tape:
    tape = _tape()
    for entry in (HEADER, Began(t=0, protocol="syncbb"), *entries):
        tape.add(entry)
    tape.end()
    return tape


def test_that_each_message_of_a_short_conversation_is_a_moment() -> None:
    tape = _taken(_decided("A", 1), _said(1), _decided("B", 2), _said(2, sender="B", receiver="C"), _decided("B", 3))
    assert [moment.count for moment in tape.moments] == [1, 1]
    assert [tape.values_at(number) for number in range(2)] == [{"A.d": 1, "B.d": 2}, {"A.d": 1, "B.d": 3}]
    assert [tape.unsettled_at(number) for number in range(2)] == [{"B"}, set()]
    assert [tape.messages_at(number) for number in range(2)] == [1, 2]
    assert [dict(moment.links) for moment in tape.moments] == [{("A", "B"): 1}, {("B", "C"): 1}]
    assert [one.words for one in tape.words_at(1, 9)] == ["Hello (inform): number = 2", "Hello (inform): number = 1"]


def test_that_strangers_are_no_part_of_it() -> None:
    tape = _taken(_said(1, sender="X"), _said(2, receiver="X"), _decided("X", 1), _said(3))
    assert (tape.messages, tape.values_at(0)) == (1, {})


def test_that_what_was_decided_in_an_epoch_before_is_void() -> None:
    again = Began(t=0, protocol="dynabt", epoch=1)
    first = _decided("A", 1), _said(1), _decided("B", 2), _decided("C", 3), _said(2)
    tape = _taken(*first, again, _decided("A", 1), _said(3), _decided("B", 5), _said(4))
    assert [tape.values_at(number) for number in range(4)] == [
        {"A.d": 1, "B.d": 2, "C.d": 3},
        {"A.d": 1, "B.d": 2, "C.d": 3},
        {"A.d": 1, "B.d": 5},
        {"A.d": 1, "B.d": 5},
    ]
    assert tape.unsettled_at(1) == {"B", "C"}
    assert tape.unsettled_at(2) == frozenset()


def test_that_an_epoch_without_a_word_is_a_moment_of_its_own() -> None:
    tape = _taken(_decided("A", 1), _said(1), Began(t=0, protocol="dynabt", epoch=1), _decided("A", 2))
    assert [moment.count for moment in tape.moments] == [1, 0]
    assert [tape.values_at(number) for number in range(2)] == [{"A.d": 1}, {"A.d": 2}]
    assert tape.words_at(1, 9) == tape.words_at(0, 9)


def test_that_who_decides_the_same_again_has_settled() -> None:
    tape = _taken(_decided("A", 1), _said(1), _decided("A", 1), _said(2), _decided("A", 2), _decided("A", 1))
    assert tape.unsettled_at(0) == frozenset()


def test_that_epochs_are_told_apart_in_a_long_conversation() -> None:
    entries = [_said(number) for number in range(3 * MOST_MOMENTS)]
    again = Began(t=0, protocol="dynabt", epoch=1)
    tape = _taken(_decided("A", 1), *entries, again, _decided("B", 2), *entries)
    assert len(tape.moments) <= 2 * MOST_MOMENTS
    assert tape.values_at(0) == {"A.d": 1}
    assert tape.values_at(len(tape.moments) - 1) == {"B.d": 2}
    assert tape.unsettled_at(0) == {"A", "B"}


@looped("count", [1, MOST_MOMENTS, 2 * MOST_MOMENTS, 2 * MOST_MOMENTS + 1, 20_011])
def test_that_a_long_conversation_has_few_moments_and_nothing_is_lost(count: int) -> None:
    chance, entries = Random(count), list[JournalEntry]()
    now: dict[str, int] = {}
    for number in range(count):
        entries.append(_said(number))
        if chance.random() < 0.3:
            robot = chance.choice(ROBOTS)
            now[f"{robot}.d"] = number
            entries.append(_decided(robot, number))
    tape = _taken(*entries)
    assert len(tape.moments) <= 2 * MOST_MOMENTS
    assert sum(moment.count for moment in tape.moments) == tape.messages == count
    assert tape.values_at(len(tape.moments) - 1) == now
    assert sum(sum(moment.links.values()) for moment in tape.moments) == count
    assert all(len(moment.last_messages) <= WORDS_SAVED for moment in tape.moments)
    assert tape.words_at(len(tape.moments) - 1, 1)[0].words == f"Hello (inform): number = {count - 1}"
    if count <= 2 * MOST_MOMENTS:
        assert all(moment.count == 1 for moment in tape.moments)


def _written(file: Path, *events: Sent | Decided | Began) -> Path:
    recorder = JournalRecorder(HEADER)
    for event in events:
        recorder(event)
    file.write_bytes(recorder.content())
    return file


def test_that_it_is_read_in_the_order_of_time(tmp_path: Path) -> None:
    file = _written(tmp_path / "j", Began(t=0, protocol="syncbb"), _said(3, 3), _said(1, 1), _said(2, 2))
    tape = recorded(file, _tape())
    assert [moment.last_messages[0].words[-1] for moment in tape.moments] == ["1", "2", "3"]
    assert tape.is_whole


def test_that_a_journal_that_broke_off_is_read_to_there(tmp_path: Path) -> None:
    file = _written(tmp_path / "j", *(_said(number) for number in range(9_000)))
    file.write_bytes(file.read_bytes()[:-100])
    assert recorded(file, _tape()).messages > 0


def test_that_no_more_is_read_and_sorted_than_is_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.app.runs.tape.MOST_READ", 5_000)
    late = (_said(number, t=number - 20_000) for number in range(10_000, 20_000))
    file = _written(tmp_path / "j", Began(t=0, protocol="syncbb"), *(_said(number) for number in range(10_000)), *late)
    read = recorded(file, _tape())
    assert int(read.words_at(0, 1)[0].words.split()[-1]) < 10_000
    assert not read.is_whole
    assert read.messages < 10_000
    monkeypatch.setattr("robochoc.app.runs.tape.MOST_READ", 30_000)
    assert recorded(file, _tape()).is_whole


def test_that_nobody_reads_on_when_nobody_waits(tmp_path: Path) -> None:
    file = _written(tmp_path / "j", *(_said(number) for number in range(9_000)))
    tape = recorded(file, _tape(), is_needed=lambda: False)
    assert not tape.is_whole


@pytest.mark.parametrize("protocol", ["abt", "awc"])
def test_that_the_end_is_the_answer_where_robots_step_aside(protocol: str) -> None:
    team = triangle(2)
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MINIMUM, cache=False)
    journal = record(team, options)
    assert journal.outcome is not None
    assert journal.outcome.withdrawn
    tape = _tape([*team.order])
    for event in journal.events:
        tape.add(event)
    tape.end()
    assert tape.values_at(len(tape.moments) - 1) == journal.outcome.assignment


@looped("content", [b"", b"nonsense", b"{}\n"])
def test_that_what_is_no_journal_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "j").write_bytes(content)
    with suppress(JournalError):
        assert recorded(tmp_path / "j", _tape()).messages == 0
    with pytest.raises(NoFileError):
        recorded(tmp_path, _tape())


@looped(("count", "seconds"), [(1, LEAST_S), (38, 5.7), (400, MOST_S)])
def test_that_it_is_played_in_a_time_that_can_be_followed(count: int, seconds: float) -> None:
    player = Player(count)
    player.toggle()
    ticks, seen = 0, []
    while player.playing:
        seen.append(player.moment)
        player.advance(0.1)
        ticks += 1
    assert abs(ticks * 0.1 - seconds) < 0.25
    assert seen[0] == 0
    assert seen == sorted(seen)
    assert player.ended
    player.toggle()
    assert (player.moment, player.playing) == (0, True)


def test_that_steps_and_seeks_pause_and_stay_within() -> None:
    player = Player(10)
    player.toggle()
    player.step(-3)
    assert (player.moment, player.playing) == (0, False)
    player.step(1)
    assert player.moment == 1
    for odd in (None, "3", float("nan"), [2], True):
        player.seek(odd)
    assert player.moment == 1
    player.seek(10**400)
    assert player.moment == 9
    for odd in (None, "fast", 1e9, -1):
        player.set_speed(odd)
    assert player.speed == 1.0
    player.set_speed(0.25)
    assert player.speed == 0.25


def test_that_a_large_team_is_drawn_now_and_then_while_it_is_played() -> None:
    small, large, still = Frames(), Frames(), Frames()
    ticks = [number * 0.1 for number in range(100)]
    assert all(small.is_due(tick, large=False, playing=True) for tick in ticks)
    drawn = [tick for tick in ticks if large.is_due(tick, large=True, playing=True)]
    assert drawn[0] == 0
    assert 9 <= len(drawn) * LARGE_S <= 10
    assert large.is_due(ticks[-1], large=True, playing=False)
    assert all(still.is_due(tick, large=True, playing=False) for tick in ticks)


def test_messages_of_sfb_are_in_words_for_everyone() -> None:
    sfb = {kind.__name__ for kind in get_args(SFB.messages)}
    assert {key.removeprefix("message.") for key in catalogue() if key.startswith("message.")} == sfb
    for kind in sfb:
        sent = msgspec.structs.replace(SENT, type=kind)
        assert in_words(sent, JournalSentences()) == ("A", "B", kind, say(f"message.{kind}"))
