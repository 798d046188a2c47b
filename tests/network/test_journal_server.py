"""The journal as the master gives it out: piece by piece, to who may have it, and never more than was written."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import BinaryIO

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.network import journal_server as module
from robochoc.communication.network.control_messages import JournalAnswer, JournalRequest
from robochoc.communication.network.journal_server import (
    MAX_ANSWERS_PER_S,
    PIECE_BYTES,
    SNIFF,
    JournalServer,
    NotAnsweredError,
    Piece,
    Publication,
    piece_in,
    question,
)
from robochoc.communication.network.master_events import MasterEvents
from robochoc.journal.entries import JournalError
from robochoc.journal.events import AnyEvent, Granted, Refused
from tests.support.cases import looped

RUN = "run"


@pytest.fixture
def file() -> Iterator[BinaryIO]:
    with tempfile.TemporaryFile() as file:
        yield file


@pytest.fixture
def publication(file: BinaryIO) -> Publication:
    made = Publication(file.fileno())
    made.run = RUN
    return made


def piece(publication: Publication, start: int, name: str = "Eye") -> Piece:
    return piece_in(publication.answer(name, question(RUN, start)))


def test_all_of_it_in_pieces_from_wherever_one_is(publication: Publication) -> None:
    content = bytes(range(256)) * 1000
    publication.write(content[:1000])
    assert piece(publication, 0) == Piece(RUN, 0, content[:1000], over=False)
    assert piece(publication, 1000) == Piece(RUN, 1000, b"", over=False)
    publication.write(content[1000:])
    got = b""
    while len(got) < len(content):
        one = piece(publication, len(got))
        assert 0 < len(one.content) <= PIECE_BYTES
        got += one.content
    assert got == content
    assert not piece(publication, len(got)).over
    publication.end()
    assert piece(publication, len(got)) == Piece(RUN, len(got), b"", over=True)
    assert not piece(publication, 0).over  # a late one has more to ask for
    with pytest.raises(NotAnsweredError, match="has 256,000 bytes"):
        piece(publication, len(got) + 1)


def test_what_has_not_been_written_yet_is_when_somebody_has_all_the_rest(publication: Publication) -> None:
    waiting = [b"second", b"first"]
    publication.fresh = lambda: publication.write(waiting.pop()) if waiting else None
    assert (piece(publication, 0).content, len(waiting)) == (b"first", 1)
    assert (piece(publication, 0).content, len(waiting)) == (b"first", 1)
    assert (piece(publication, 5).content, len(waiting)) == (b"second", 0)


def test_the_end_is_waited_for_as_long_as_followers_are_there(
    publication: Publication, monkeypatch: pytest.MonkeyPatch
) -> None:
    publication.write(b"all")
    assert not publication.lagging
    found = []
    for name in ("Eye", "Ear"):
        piece(publication, 0, name)
    found.append(publication.lagging)
    publication.end()
    piece(publication, 3, "Eye")
    found.append(publication.lagging)
    monkeypatch.setattr(module, "PRESENT_S", 0)  # Ear has not asked for so long
    found.append(publication.lagging)
    assert found == [True, True, False]


def test_one_who_asks_without_end_is_not_answered_and_others_are(
    publication: Publication, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now))
    for _ in range(MAX_ANSWERS_PER_S):
        piece(publication, 0)
    with pytest.raises(NotAnsweredError, match="questions a second"):
        piece(publication, 0)
    assert piece(publication, 0, "Ear").content == b""
    now += 1.5
    assert piece(publication, 0).content == b""


def test_where_nothing_can_be_written_the_run_goes_on_and_followers_are_told() -> None:
    with Path("/dev/full").open("r+b", buffering=0) as full:
        publication = Publication(full.fileno())
        desk = JournalServer(RUN, lambda _name: True, MasterEvents(None))
        desk.publication = publication
        assert desk.welcome("Eye", JournalRequest(1)).why == ""
        publication.write(b"block")
        publication.write(b"block")
        assert "cannot be written any more: No space left" in desk.welcome("Eye", JournalRequest(1)).why
        assert desk.answer("Eye", question(RUN, 0)) is None


def test_after_it_is_closed_the_file_is_not_touched(publication: Publication, file: BinaryIO) -> None:
    publication.close()
    file.close()
    with pytest.raises(NotAnsweredError):
        piece(publication, 0)


@given(content=st.binary(max_size=300) | st.binary(max_size=20).map(msgspec.msgpack.encode))
def test_no_bytes_are_answered_or_read_otherwise(content: bytes) -> None:
    with tempfile.TemporaryFile() as file:
        publication = Publication(file.fileno())
        with pytest.raises(NotAnsweredError):
            publication.answer("Eye", content)
    with pytest.raises(JournalError):
        piece_in(content)


@looped("start", [-1, 2**53 + 1, 2**70, 1.5, "0", None])
def test_places_that_no_journal_has(start: object, publication: Publication) -> None:
    with pytest.raises(NotAnsweredError, match="malformed"):
        publication.answer("Eye", msgspec.msgpack.encode([RUN, start]) if start != 2**70 else b"\x92\xa3run\xcf")
    with pytest.raises(JournalError):
        piece_in(msgspec.msgpack.encode([RUN, 0, bytes(PIECE_BYTES + 1), False]))


# The desk


def test_the_desk_asks_who_may_and_tells_what_it_said(publication: Publication) -> None:
    told: list[AnyEvent] = []
    may: set[str] = {"Eye"}
    desk = JournalServer(RUN, may.__contains__, MasterEvents(told.append))
    assert desk.welcome("Eye", JournalRequest(1)).why.endswith("start it with --sniffable")
    assert desk.answer("Eye", question(RUN, 0)) is None
    assert not desk.lagging
    told.clear()

    desk.publication = publication
    publication.write(b"all")
    for _ in range(3):
        assert desk.welcome("Eye", JournalRequest(7)) == JournalAnswer(7, RUN, "")
    assert (desk.answer("Eye", question(RUN, 0)), desk.lagging) != (None, False)
    assert [(event.who, event.what) for event in told if isinstance(event, Granted)] == [("Eye", SNIFF)]
    told.clear()

    may.clear()
    assert "authority enrol Eye --may sniff" in desk.welcome("Eye", JournalRequest(8)).why
    assert desk.answer("Ear", question(RUN, 0)) is None
    assert [(event.who, event.what) for event in told if isinstance(event, Refused)] == [("Eye", SNIFF), ("Ear", SNIFF)]
