"""A journal that is read piece by piece comes to what it comes to when it is read as a whole."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robochoc.journal.events import AnyEvent, Began, Event, Settled
from robochoc.journal.journal import JournalError, read_journal, sorted_by_time
from robochoc.model.outcome import Outcome
from robochoc.sniffer import live_trace
from robochoc.sniffer.cache import Cache
from robochoc.sniffer.growing_file import GrowingFile, NoFileError
from robochoc.sniffer.live_trace import LiveTrace, events_by_time
from robochoc.sniffer.trace import Trace
from tests.support.examples import examples
from tests.support.sniffer_server import header, journal_of, run_events

QUICK = examples(5, also_suppress=(HealthCheck.function_scoped_fixture,))


@pytest.fixture(scope="module")
def run() -> tuple[list[AnyEvent], Outcome]:
    return run_events()


@contextmanager
def opened(path: Path, content: bytes) -> Iterator[GrowingFile]:
    path.write_bytes(content)
    with path.open("rb") as file:
        yield GrowingFile(file.fileno())


def numbers(trace: Trace) -> object:
    return [list(column) for column in (*trace.messages, *trace.steps)] + [list(trace.packets), trace.decisions]


def late(events: list[AnyEvent], robot: str) -> list[AnyEvent]:
    """What `robot` reports comes at the end of each run: robots report in bundles."""
    runs: list[list[AnyEvent]] = []
    for event in events:
        if isinstance(event, Began) or not runs:
            runs.append([])
        runs[-1].append(event)
    return [event for run in runs for event in sorted(run, key=lambda event: robot in _who(event))]


def _who(event: Event) -> set[str]:
    name = {"Sent": "sender", "Received": "receiver"}.get(type(event).__name__, "robot")
    return {getattr(event, name, "")}


@given(
    piece=st.integers(500, 20_000),
    at_once=st.integers(50, 3000),
    pending=st.sampled_from([0, 100, 100_000]),
    age_s=st.sampled_from([0.0, 60.0]),
)
@QUICK
def test_in_pieces_as_in_whole(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    run: tuple[list[AnyEvent], Outcome],
    piece: int,
    at_once: int,
    pending: int,
    age_s: float,
) -> None:
    monkeypatch.setattr(live_trace, "MOST_PENDING", pending)
    monkeypatch.setattr(live_trace, "PIECE_BYTES", piece)
    monkeypatch.setattr(live_trace, "_EVENTS_AT_ONCE", at_once)
    content = journal_of(late(run[0], "Robot1.1"), run[1], header("processes"))
    whole = Trace.of(read_journal(content))
    before = 0
    with opened(tmp_path / "run.journal", content) as window:
        follows = LiveTrace(window, lambda: age_s)
        while follows.advance():
            assert follows.trace is None or follows.trace.generation == before or follows.settled or age_s
        assert follows.trace is not None
        assert numbers(follows.trace) == numbers(whole)
        assert (follows.trace.over, follows.trace.outcome, follows.loaded) == (True, whole.outcome, 1)


def test_events_by_time_are_the_journals(tmp_path: Path, run: tuple[list[AnyEvent], Outcome]) -> None:
    content = journal_of(late(run[0], "Robot2.2"), run[1], header("processes"))
    with opened(tmp_path / "run.journal", content) as window:
        window.widen(len(content))
        events = [event for some in events_by_time(window) for event in some]
    assert tuple(events) == read_journal(content).events


@given(
    times=st.lists(st.lists(st.integers(0, 9), max_size=30), min_size=1, max_size=3),
    cuts=st.lists(st.integers(0, 90), max_size=6),
    again=st.lists(st.integers(0, 90), max_size=6),
    pending=st.sampled_from([0, 3, 100]),
)
@examples(200, also_suppress=(HealthCheck.function_scoped_fixture,))
def test_events_are_yielded_in_order_as_soon_as_possible(
    monkeypatch: pytest.MonkeyPatch, times: list[list[int]], cuts: list[int], again: list[int], pending: int
) -> None:
    """In whatever pieces the journal is read the first and the second time, the order is that of `read_journal`."""
    monkeypatch.setattr(live_trace, "MOST_PENDING", pending)
    events: list[AnyEvent] = []
    for run in times:
        events.append(Began(t=0, protocol="ABT"))
        events += [Settled(t=t, robot="a", clock=place, checks=0) for place, t in enumerate(run)]
    floors = live_trace.EarliestTimes()
    for piece in _pieces(events, cuts):
        floors.add(piece)
    lists = [*live_trace.sorted_by_time(_pieces(events, again), floors)]
    assert [event for some in lists for event in some] == [*sorted_by_time(events)]
    assert floors.disordered == any(run != sorted(run) for run in times)


def _pieces(events: list[AnyEvent], cuts: list[int]) -> list[list[AnyEvent]]:
    return [events[start:end] for start, end in pairwise([0, *sorted(cuts), len(events)])]


def test_whoever_writes_is_not_disturbed(tmp_path: Path, run: tuple[list[AnyEvent], Outcome]) -> None:
    """The descriptor's own place stays where it was: a parent writes through the same one."""
    content = journal_of(*run)
    path = tmp_path / "run.journal"
    with path.open("w+b") as file:
        file.write(content)
        file.flush()
        follows = LiveTrace(GrowingFile(file.fileno()))
        while follows.advance():
            pass
        assert file.tell() == os.lseek(file.fileno(), 0, os.SEEK_CUR) == len(content)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    folder = os.open(tmp_path, os.O_RDONLY)
    try:
        for descriptor in (reading, folder):
            with pytest.raises(NoFileError):
                GrowingFile(descriptor)
    finally:
        for descriptor in (reading, writing, folder):
            os.close(descriptor)


@given(content=st.binary(min_size=1, max_size=300))
@QUICK
def test_no_bytes_do_harm(tmp_path: Path, content: bytes) -> None:
    with opened(tmp_path / "any", content) as window:
        follows = LiveTrace(window, lambda: 1e9)
        try:
            while follows.advance():
                pass
        except JournalError:
            return
    assert follows.trace is None or follows.trace.over


@settings(deadline=None)
@given(sizes=st.lists(st.tuples(st.integers(0, 9), st.integers(0, 60)), max_size=60))
def test_a_cache_never_holds_more_than_it_may(sizes: list[tuple[int, int]]) -> None:
    cache = Cache(100)
    for key, size in sizes:
        cache.put(key, bytes(size))
        assert cache.get(key) == bytes(size)
        assert sum(len(cache.get(other) or b"") for other in range(10)) <= 100
