"""Journals: what goes in comes out, in both forms, in order, while it is written, and when there is no room."""

from __future__ import annotations

import errno
import io
import os
import resource
import sys
import threading
from decimal import Decimal
from pathlib import Path
from typing import BinaryIO, cast

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent, Began, Decided, Given, Heard, Improved, Received, Refused, Sent, Settled
from robochoc.journal.journal import (
    Follower,
    Header,
    JournalEntry,
    JournalError,
    JournalFile,
    JournalRecorder,
    is_journal,
    lines_of,
    metrics_of,
    read_journal,
    sorted_by_time,
)
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Constraint, Relation, Semantics
from robochoc.run import Options, Runtime, solve
from robochoc.verification.objective import Objective
from tests.support.cases import looped
from tests.support.events import any_event, headers, outcomes
from tests.support.examples import examples
from tests.support.problems import team_of

HEADER = Header(team="four", protocol="abt", runtime="simulator", seed=0)
OUTCOME = Outcome(Verdict.SOLUTION, team="four", protocol="abt", runtime="simulator", seed=0)


def told(events: list[AnyEvent], every: int = 3, header: Header = HEADER) -> bytes:
    """The journal of `events`, a block every so many."""
    recorder = JournalRecorder(header)
    for number, event in enumerate(events):
        recorder(event)
        if number % every == 0:
            recorder.flush()
    return recorder.content()


def settled(number: int, t: float | None = None) -> Settled:
    return Settled(t=number if t is None else t, robot=f"R{number % 3}", clock=number, checks=number)


# What goes in comes out


@given(header=headers, events=st.lists(any_event, max_size=12), outcome=st.none() | outcomes)
@examples(100)
def test_what_goes_in_comes_out_in_both_forms(header: Header, events: list[AnyEvent], outcome: Outcome | None) -> None:
    recorder = JournalRecorder(header)
    recorder.outcome = outcome
    for event in events:
        recorder(event)
    content = recorder.content()
    assert is_journal(content)
    lines = Follower(io.BytesIO(content)).read()
    assert lines[0] == header
    assert lines[1 : 1 + len(events)] == events
    journal = read_journal(content)
    assert (journal.header, journal.outcome, journal.damage) == (header, outcome, None)
    assert journal.events == tuple(sorted_by_time(events))
    text = b"".join(lines_of(journal))
    assert is_journal(text)
    again = read_journal(text)
    assert [*lines_of(again)] == text.splitlines(keepends=True)
    assert len(again.events) == len(events)


def test_decimal_costs_are_numbers_in_the_text_form() -> None:
    event = Improved(t=0, cost=Decimal("1.50"), assignment={})
    header = Header(team="t", protocol="p", runtime="processes", seed=0)
    (line,) = list(lines_of(read_journal(told([event], header=header))))[1:]
    assert b'"cost":1.5' in line


@given(st.lists(st.floats(0, 1e6), min_size=1, max_size=10))
@examples(50)
def test_clocks_are_kept_to_the_nanosecond_and_in_order(times: list[float]) -> None:
    events: list[AnyEvent] = [settled(number, t) for number, t in enumerate(sorted(times))]
    kept = read_journal(told(events, header=Header(team="t", protocol="p", runtime="processes", seed=0))).events
    assert all(abs(one.t - other.t) < 1e-9 for one, other in zip(events, kept, strict=True))
    assert [event.robot for event in kept if isinstance(event, Settled)] == [f"R{n % 3}" for n in range(len(events))]


def test_a_clock_that_is_no_number_spoils_nothing() -> None:
    events: list[AnyEvent] = [settled(1, float("nan")), settled(2, float("inf")), settled(3, 1.5)]
    assert [event.t for event in read_journal(told(events)).events] == [0, 0, 1.5]


def test_events_are_in_order_within_a_run_and_each_robots_own_stay_so() -> None:
    runs: list[AnyEvent] = [settled(0, 7), Began(t=0, protocol="A"), settled(1, 3), settled(2, 1), settled(4, 1)]
    runs += [Began(t=0, protocol="B"), settled(5, 2), settled(6, 0.5)]
    assert [event.t for event in read_journal(told(runs)).events] == [7, 0, 1, 1, 3, 0, 0.5, 2]
    assert [event.clock for event in read_journal(told(runs)).events if isinstance(event, Settled)] == [
        0, 2, 4, 1, 6, 5,
    ]  # fmt: skip


def test_improvements_come_at_the_end_of_each_run_that_minimises() -> None:
    soft = Relation("soft", 2, Semantics.SOFT, ((1, 1),), (5.0,))
    team = team_of({"A": (1, 2), "B": (1, 2)}, [Constraint("C", soft, ("A", "B"), ("A", "B"))])
    recorder = JournalRecorder(HEADER, lambda: Objective(team))

    def decide(t: float, robot: str, name: str, value: int) -> None:
        recorder(Decided(t=t, robot=robot, assignment={name: value}, clock=0))
        recorder.flush()

    recorder(Began(t=0, protocol="DSA", minimises=True))
    decide(2, "RB", "B", 1)
    decide(1, "RA", "A", 1)
    decide(3, "RB", "B", 2)
    recorder(settled(9, 3))
    recorder(Began(t=0, protocol="ABT"))
    decide(1, "RA", "A", 2)
    recorder(Began(t=0, protocol="DSA", minimises=True))
    recorder(Heard(t=1, robot="RA", cost=7, values={"RA": (1,), "RB": (1,)}))
    kinds = [type(event).__name__ for event in read_journal(recorder.content()).events]
    first = ["Began", "Decided", "Decided", "Improved", "Decided", "Settled", "Improved"]
    assert kinds == [*first, "Began", "Decided", "Began", "Heard", "Improved"]
    costs = [event.cost for event in read_journal(recorder.content()).events if isinstance(event, Improved)]
    assert costs == [5, 0, 7]


def test_what_is_too_large_for_a_block_is_left_out_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.journal.recorder.MAX_BLOCK_BYTES", 1_000)
    large = "x" * 1_001
    sent = Sent(t=0, sender="A", receiver="B", type="Util", content={"table": large}, bytes=1, clock=0)
    given_ = Given(t=0, order=("A",), robots={"A": large})
    events = read_journal(told([settled(0), sent, given_, settled(1)], every=10)).events
    assert [type(event).__name__ for event in events] == ["Settled", "Sent", "Given", "Settled"]
    assert "more than 1,000" in events[1].content["left out"]  # type: ignore[union-attr]
    assert "more than 1,000" in events[2].why  # type: ignore[union-attr]


# While it is written


@looped(
    "poison",
    [
        Sent(t=1, sender="R", receiver="S", type="X", content={"x": {(1, 2): 3}}, bytes=1, clock=0),
        Sent(t=1, sender="R", receiver="S", type="X", content={"x": msgspec.msgpack.Ext(5, b"")}, bytes=1, clock=0),
        Settled(t=1, robot="R", clock=2**63, checks=0),
        Settled(t=1, robot="R", clock=1, checks=2**64 - 1),
        Received(t=1, sender="S", receiver="R", type="X", clock=-(2**63) - 1),
    ],
)
def test_what_could_not_be_read_again_spoils_nothing(poison: AnyEvent) -> None:
    """A robot of another machine may tell of it: all that msgpack holds comes over the wire."""
    first, instead, last = read_journal(told([settled(0), poison, settled(2)])).events
    assert (first, last) == (settled(0), settled(2))
    if isinstance(poison, Sent):
        assert isinstance(instead, Sent)
        assert list(instead.content) == ["left out"]
    else:
        assert isinstance(instead, Refused)
        assert instead.who == "R"


def test_without_any_event_nothing_is_written(tmp_path: Path) -> None:
    (tmp_path / "run.journal").write_bytes(b"old")
    file = JournalFile(tmp_path / "run.journal")
    recorder = JournalRecorder(HEADER, sinks=[file.write])
    empty = [recorder.is_empty]
    recorder(settled(0))
    assert [*empty, recorder.is_empty] == [True, False]
    file.close()
    assert is_journal((tmp_path / "run.journal").read_bytes())


def test_it_is_followed_while_it_is_written_through_the_same_descriptor(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    path.write_bytes(b"old")
    file = JournalFile(path)
    recorder = JournalRecorder(HEADER, sinks=[file.write])
    recorder.flush()
    with path.open("rb") as following:
        follower = Follower(following)
        assert follower.read() == [HEADER]
        assert follower.read() == []
        for number in range(20):
            recorder(settled(number))
            recorder.flush()
            assert follower.read() == [settled(number)]
        assert following.tell() == 0
        recorder.outcome = OUTCOME
        recorder.close()
        before = follower.is_over
        assert [type(line).__name__ for line in follower.read()] == ["Ended"]
        assert (before, follower.is_over) == (False, True)
        assert follower.finish() == ([], None)
    file.close()
    assert read_journal(path.read_bytes()).outcome == OUTCOME


def test_a_call_ends_though_the_writer_is_faster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in an endless run on a busy machine: whenever something has been read, there is more."""
    pread, numbers = os.pread, iter(range(1000))
    with (tmp_path / "run.journal").open("wb", buffering=0) as file:
        recorder = JournalRecorder(HEADER, sinks=[file.write])

        def once_more_is_written(descriptor: int, size: int, place: int) -> bytes:
            recorder(settled(next(numbers)))
            recorder.flush()
            return pread(descriptor, size, place)

        with (tmp_path / "run.journal").open("rb") as following:
            monkeypatch.setattr(os, "pread", once_more_is_written)
            follower = Follower(following)
            lines = [line for _ in range(10) for line in follower.read()]
    assert lines[0] == HEADER
    assert lines[1:] == [settled(number) for number in range(len(lines) - 1)]
    assert 10 < len(lines) < 100


@pytest.mark.parametrize("text", [False, True])
def test_it_is_followed_byte_by_byte(text: bool) -> None:  # noqa: FBT001 - a parameter
    content = told([settled(number) for number in range(7)])
    if text:
        content = b"".join(lines_of(read_journal(content)))
    read, write = os.pipe()
    with os.fdopen(read, "rb", buffering=0) as pipe, os.fdopen(write, "wb", buffering=0) as writer:
        os.set_blocking(read, False)
        follower = Follower(cast("BinaryIO", _Patient(pipe)))
        lines: list[JournalEntry] = []
        for place in range(len(content)):
            writer.write(content[place : place + 1])
            lines += follower.read()
        assert lines == [HEADER, *(settled(number) for number in range(7))]
        assert follower.finish() == ([], None)


class _Patient(io.RawIOBase):
    """A pipe that has nothing yet is not at its end, but reads as if it were."""

    def __init__(self, pipe: io.RawIOBase) -> None:
        self._pipe = pipe

    def read(self, size: int = -1) -> bytes:
        return self._pipe.read(size) or b""


def test_reading_stops_where_the_reader_wants() -> None:
    follower = Follower(io.BytesIO(told([settled(number) for number in range(30)])))
    pieces = [len(follower.read(4)) for _ in range(8)]
    assert sum(pieces) == 31
    assert max(pieces) <= 4 + 3


def test_threads_may_tell_at_the_same_time() -> None:
    recorder = JournalRecorder(HEADER)

    def tell(robot: int) -> None:
        for number in range(2000):
            recorder(Settled(t=number, robot=f"R{robot}", clock=number, checks=number))

    threads = [threading.Thread(target=tell, args=(robot,)) for robot in range(4)]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert len(read_journal(recorder.content()).events) == 8000


# When it cannot be written


class _Interrupted:
    """A sink in which, once, an interrupt comes before anything is written."""

    def __init__(self, at: int) -> None:
        self.content = bytearray()
        self._at = at

    def __call__(self, block: bytes) -> None:
        self._at -= 1
        if self._at == 0:
            raise KeyboardInterrupt
        self.content += block


@looped("at", range(2, 6))
def test_an_interrupt_costs_no_event(at: int) -> None:
    sink, other = _Interrupted(at), io.BytesIO()
    recorder = JournalRecorder(HEADER, sinks=[other.write, sink])
    taken = 0
    try:
        for number in range(10):
            taken += 1
            recorder(settled(number))
            recorder.flush()
    except KeyboardInterrupt:
        recorder.close()
    assert sink.content == other.getvalue()
    assert read_journal(bytes(sink.content)).events == tuple(settled(number) for number in range(taken))


def test_a_sink_that_fails_does_not_harm_the_others() -> None:
    good = io.BytesIO()

    def full(_: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    recorder = JournalRecorder(HEADER, sinks=[full, good.write])
    recorder(settled(0))
    recorder.close()
    assert [failure.errno for failure in recorder.failures] == [errno.ENOSPC]
    assert read_journal(good.getvalue()).events == (settled(0),)


def test_a_full_disk_leaves_whole_blocks(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    file = JournalFile(path)
    recorder = JournalRecorder(HEADER, sinks=[file.write])
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        for number in range(100):
            recorder(settled(number))
            recorder.flush()
        recorder.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        file.close()
    (failure,) = recorder.failures
    assert (failure.errno, failure.filename) == (errno.EFBIG, str(path))
    journal = read_journal(path.read_bytes())
    assert journal.damage is None
    assert 5 < len(journal.events) < 100


def test_what_cannot_be_replaced_stays(tmp_path: Path) -> None:
    recorder = JournalRecorder(HEADER, sinks=[JournalFile(tmp_path / "no" / "run.journal").write])
    recorder(settled(0))
    assert [failure.errno for failure in recorder.failures] == [errno.ENOENT]
    assert list(tmp_path.iterdir()) == []


def test_a_pipe_gets_the_blocks_as_they_come(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    found: list[bytes] = []
    reader = threading.Thread(target=lambda: found.append(pipe.read_bytes()))
    reader.start()
    file = JournalFile(pipe)
    recorder = JournalRecorder(HEADER, sinks=[file.write])
    recorder(settled(0))
    recorder.close()
    file.close()
    reader.join()
    assert read_journal(found[0]).events == (settled(0),)


# Journals of runs


@pytest.mark.parametrize("runtime", [Runtime.SIMULATOR, Runtime.PROCESSES])
def test_a_runs_journal_is_small_and_has_everything(runtime: Runtime) -> None:
    team = queens3d(4)
    recorder = JournalRecorder(Header(team=team.name, protocol="abt", runtime=runtime, seed=0))
    outcome = solve(team, Options(protocol="abt", runtime=runtime), observer=recorder)
    recorder.outcome = outcome
    content = recorder.content()
    journal = read_journal(content)
    messages = sum(outcome.metrics.messages.values())
    assert metrics_of(journal.events).messages == outcome.metrics.messages
    assert len([event for event in journal.events if isinstance(event, Received)]) <= messages
    assert len(content) < 25 * messages
    assert 5 * len(content) < sum(map(len, lines_of(journal)))


@looped("content", [b"", b"\x89", b"PK\x03\x04", b'{"event":"Began","protocol":"x","t":0}\n', b"[" * 10**6])
def test_what_is_no_journal_is_refused(content: bytes) -> None:
    with pytest.raises(JournalError):
        read_journal(content)
