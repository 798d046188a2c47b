"""A journal that arrives from a master who may be anybody: whole blocks are kept, and nothing else is."""

from __future__ import annotations

from itertools import accumulate
from random import Random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.network.journal_server import PIECE_BYTES, Piece
from robochoc.journal.blocks import BEGINNING, PREAMBLE, JournalDamagedError, frame_block
from robochoc.journal.entries import JournalError
from robochoc.run.networked.address import Address
from robochoc.sniffer.remote import FollowResult, IncomingJournal, WholeBlocks

RUN = "run"


def blocks(count: int) -> list[bytes]:
    made, digest = [PREAMBLE], BEGINNING
    for number in range(count):
        block, digest = frame_block(Random(number).randbytes(50 * number), digest)
        made.append(block)
    return made


BLOCKS = blocks(8)
WHOLE = b"".join(BLOCKS)
ENDS = [0, *accumulate(map(len, BLOCKS))]


def told(start: int, content: bytes, *, over: bool = False, run: str = RUN) -> bytes:
    return msgspec.msgpack.encode(Piece(run, start, content, over))


class Kept:
    """An arriving journal, and what of it was kept."""

    def __init__(self) -> None:
        self.content = b""
        self.journal = IncomingJournal(Address("master"), RUN, self._keep)

    def _keep(self, whole: bytes) -> None:
        self.content += whole


@given(cuts=st.lists(st.integers(0, len(WHOLE)), max_size=20))
def test_whole_blocks_however_the_bytes_come(cuts: list[int]) -> None:
    kept = Kept()
    for start, end in zip([0, *sorted(cuts)], [*sorted(cuts), len(WHOLE)], strict=True):
        assert kept.journal.receive(told(start, WHOLE[start:end])) is None
        assert kept.content == WHOLE[: max(place for place in ENDS if place <= end)]
    assert kept.journal.receive(told(len(WHOLE), b"", over=True)) == FollowResult(over=True, why="the run is over")
    assert kept.content == WHOLE


@given(place=st.integers(0, len(WHOLE) - 1), change=st.integers(1, 255))
def test_nothing_is_kept_from_where_a_byte_is_another(place: int, change: int) -> None:
    kept = Kept()
    content = bytearray(WHOLE)
    content[place] ^= change
    ending = kept.journal.receive(told(0, bytes(content))) or kept.journal.receive(told(len(WHOLE), b"", over=True))
    assert ending
    assert not ending.over
    assert kept.content == WHOLE[: len(kept.content)]
    assert len(kept.content) <= place


def test_a_block_that_is_missing_doubled_or_cut() -> None:
    missing, doubled = b"".join(BLOCKS[:3] + BLOCKS[4:]), b"".join(BLOCKS[:4] + BLOCKS[3:])
    for content in (missing, doubled):
        with pytest.raises(JournalDamagedError, match="checksum"):
            WholeBlocks().add(content)
    kept = Kept()
    ending = kept.journal.receive(told(0, WHOLE[:-1], over=True))
    assert ending == FollowResult(
        over=False, why=f"the run is over, but its journal is incomplete: byte {ENDS[-2]:,}: it ends within a block"
    )
    assert kept.content == WHOLE[: ENDS[-2]]
    with pytest.raises(JournalError):
        WholeBlocks().add(b"{}")


def test_pieces_of_others_and_of_another_run() -> None:
    kept = Kept()
    assert kept.journal.receive(told(7, WHOLE[:100])) is None  # an answer that comes late
    assert kept.content == b""
    for content in (b"", b"junk", told(0, bytes(PIECE_BYTES + 1))):
        ending = Kept().journal.receive(content)
        assert ending
        assert "sent an invalid journal" in ending.why
    ending = kept.journal.receive(told(0, WHOLE, run="another"))
    assert ending == FollowResult(over=False, why="the master at master:7447 was restarted")
