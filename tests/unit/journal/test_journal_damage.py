"""Journals that are cut off, damaged, or made to harm: a clear error, or what stood before, and never anything else."""

from __future__ import annotations

import io
import random
import struct
import tracemalloc
import zlib
from contextlib import suppress
from functools import cache
from hashlib import blake2b
from typing import Any

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robochoc.journal.blocks import BEGINNING, MAX_BLOCK_BYTES, PREAMBLE, frame_block
from robochoc.journal.columns import BlockError, columns_of, entries_of
from robochoc.journal.entries import Ended
from robochoc.journal.events import AnyEvent, Began, Decided, Lost, Received, Sent, Settled
from robochoc.journal.journal import (
    Follower,
    Header,
    JournalEntry,
    JournalError,
    JournalRecorder,
    lines_of,
    read_journal,
)
from robochoc.model.outcome import Outcome, Verdict
from tests.support.examples import examples

HEADER = Header(team="four", protocol="abt", runtime="simulator", seed=0)
FRAME = 24


def run(seed: int, number: int) -> list[AnyEvent]:
    """Events as robots have them."""
    chance = random.Random(seed)
    robots = ["Robot1.1", "Robot1.2", "Robot2.1"]
    events: list[AnyEvent] = [Began(t=0, protocol="ABT")]
    for t in range(number):
        one, other = chance.sample(robots, 2)
        contents: list[dict[str, Any]] = [{"value": [t]}, {"lhs": {one: [t]}, "value": [1]}, {}]
        content = chance.choice(contents)
        events += [
            Sent(t=t, sender=one, receiver=other, type="Ok", content=content, bytes=t, clock=3 * t),
            Received(t=t, sender=one, receiver=other, type="Ok", clock=3 * t),
            Decided(t=t, robot=other, assignment={"V": t}, clock=3 * t),
            Settled(t=t, robot=other, clock=3 * t, checks=2 * t),
        ]
    return [*events, Lost(t=number, robot="Robot1.1", why="killed")]


def blocks_of(seed: int, number: int = 10, every: int = 5) -> list[bytes]:
    """The journal of a run: its blocks, the first with the preamble."""
    blocks: list[bytes] = []
    recorder = JournalRecorder(HEADER, sinks=[blocks.append])
    for place, event in enumerate(run(seed, number)):
        recorder(event)
        if place % every == 0:
            recorder.flush()
    recorder.outcome = Outcome(Verdict.SOLUTION, team="four", protocol="abt", runtime="simulator", seed=0)
    recorder.close()
    return blocks


def lines_in(content: bytes) -> tuple[list[JournalEntry], str | None]:
    """All entries that can be read, in the file's order, and the damage."""
    follower = Follower(io.BytesIO(content))
    lines = follower.read()
    rest, damage = follower.finish()
    return lines + rest, damage


@cache
def whole(text: bool = False) -> tuple[bytes, list[JournalEntry]]:  # noqa: FBT001, FBT002 - one of two forms
    content = b"".join(blocks_of(0))
    if text:
        content = b"".join(lines_of(read_journal(content)))
    lines, damage = lines_in(content)
    assert damage is None
    assert len(lines) > 40
    return content, lines


def holds_no_lie(content: bytes, lines: list[JournalEntry], where: str) -> bool:
    """What comes of reading `content`, of which `lines` are true; whether anything could be read."""
    try:
        found, damage = lines_in(content)
    except JournalError:
        return False
    assert found == lines[: len(found)], where
    # All is there but for the end, of which nobody can tell that it is missing when it was a block of its own.
    assert damage is not None or len(found) in whole_lengths() or found == lines, where
    if damage is not None:
        assert damage.startswith(("byte ", "line ")), damage
    return True


@cache
def whole_lengths() -> frozenset[int]:
    """How many entries there are up to the end of each block."""
    blocks = blocks_of(0)
    return frozenset(len(lines_in(b"".join(blocks[: number + 1]))[0]) for number in range(len(blocks)))


def test_every_truncation_is_a_shorter_journal() -> None:
    content, lines = whole()
    cuts = [length for length in range(len(content)) if holds_no_lie(content[:length], lines, f"cut at {length}")]
    lengths = [len(lines_in(content[:length])[0]) for length in cuts]
    assert lengths == sorted(lengths)
    assert set(lengths) == whole_lengths() - {len(lines)}
    journal = read_journal(content[:-1])
    assert journal.outcome is None
    assert "it ends within a block" in str(journal.damage)


def test_every_truncation_of_the_text_form() -> None:
    content, lines = whole(text=True)
    for length in range(0, len(content), 3):
        try:
            found, damage = lines_in(content[:length])
        except JournalError:
            assert length <= content.index(b"\n")
            continue
        assert found == lines[: len(found)]
        assert damage is not None or content[length - 1 : length + 1].count(b"\n")


def corrupted(chance: random.Random, blocks: list[bytes], others: list[bytes]) -> tuple[str, bytes]:
    """A journal to which something has happened, in one of many ways, and what that was."""
    kind = chance.choice(["swap", "double", "drop", "strange", "bit", "byte", "range", "cut", "junk", "zeros", "gap"])
    if kind not in {"swap", "double", "drop", "strange"}:
        return kind, _overwritten(chance, kind, bytearray(b"".join(blocks)))
    blocks = [*blocks]
    one, other = chance.randrange(len(blocks)), chance.randrange(len(blocks))
    match kind:
        case "swap":
            blocks[one], blocks[other] = blocks[other], blocks[one]
        case "double":
            blocks.insert(one, blocks[other])
        case "drop":
            del blocks[one]
        case _:
            blocks[one] = others[one]
    return f"{kind} {one} {other}", b"".join(blocks)


def _overwritten(chance: random.Random, kind: str, content: bytearray) -> bytes:
    at, length = chance.randrange(len(content)), chance.randint(1, 40)
    match kind:
        case "bit":
            content[at] ^= 1 << chance.randrange(8)
        case "byte":
            content[at] = chance.randrange(256)
        case "range":
            content[at : at + length] = chance.randbytes(min(length, len(content) - at))
        case "zeros":
            content[at:] = bytes(len(content) - at)
        case "cut":
            del content[at:]
        case "gap":
            del content[at : at + length]
        case _:
            content += chance.randbytes(length)
    return bytes(content)


@pytest.mark.parametrize("count", [2_000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_thousands_of_corruptions_tell_no_lie(count: int) -> None:
    chance = random.Random(7)
    content, lines = whole()
    blocks, others = blocks_of(0), blocks_of(1)
    readable = 0
    for _ in range(count):
        where, bad = corrupted(chance, blocks, others)
        if bad == content or where.startswith("strange 0"):
            continue
        strange = where.startswith("strange") and lines_in(bad)[0] != lines[: len(lines_in(bad)[0])]
        if strange:
            # A block of another journal that follows equal ones is as true as its own; nothing after it is read.
            found, damage = lines_in(bad)
            assert damage is not None
            assert found == lines_in(b"".join(others))[0][: len(found)]
            continue
        readable += holds_no_lie(bad, lines, where)
    assert readable > count / 2


def test_corruptions_of_the_text_form_never_crash() -> None:
    chance = random.Random(8)
    content, _ = whole(text=True)
    for _ in range(1000):
        bad = bytearray(content)
        bad[chance.randrange(len(bad))] = chance.randrange(256)
        with suppress(JournalError):
            read_journal(bytes(bad))


# Made to harm: the checksums are right


def made(*contents: bytes, preamble: bytes = PREAMBLE) -> bytes:
    """A journal of blocks that hold `contents`."""
    digest = BEGINNING if preamble == PREAMBLE else blake2b(preamble, digest_size=16).digest()
    journal = preamble
    for content in contents:
        block, digest = frame_block(content, digest)
        journal += block
    return journal


VALUES = 9
"""The place of the messages' values among a block's columns."""


def columns(*lines: JournalEntry) -> bytes:
    return columns_of(lines, exact=True)


def test_a_block_that_unpacks_to_more_than_it_says_is_refused_unread() -> None:
    packer, zeros = zlib.compressobj(9), bytes(2**18)
    packed = b"".join(packer.compress(zeros) for _ in range(1000)) + packer.flush()
    sizes = struct.pack("<II", len(packed), 100)
    digest = blake2b(BEGINNING + sizes + packed, digest_size=16).digest()
    journal = PREAMBLE + sizes + digest + packed
    tracemalloc.start()
    try:
        with pytest.raises(JournalError, match="does not have the length"):
            read_journal(journal)
        assert tracemalloc.get_traced_memory()[1] < 10 * 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("sizes", [(100, MAX_BLOCK_BYTES + 1), (2**32 - 1, 100)])
def test_a_block_that_claims_too_much_is_refused(sizes: tuple[int, int]) -> None:
    journal = made(columns(HEADER)) + struct.pack("<II", *sizes) + bytes(100)
    assert "claims to have" in str(read_journal(journal).damage)


def test_other_versions_are_refused_with_both_numbers() -> None:
    with pytest.raises(JournalError, match="the format 9, but this robochoc reads format 1"):
        read_journal(made(columns(HEADER), preamble=PREAMBLE[:8] + struct.pack("<HH", 9, 0)))
    with pytest.raises(JournalError, match="entries have the version 7, but this robochoc reads 1 and 2"):
        read_journal(made(columns(msgspec.structs.replace(HEADER, version=7))))
    with pytest.raises(JournalError, match="checksum"):
        read_journal(PREAMBLE[:10] + b"\x01\x00" + made(columns(HEADER))[12:])


def test_entries_in_a_wrong_place_are_damage() -> None:
    lost = Lost(t=0, robot="R", why="")
    ended = Ended(outcome=Outcome(Verdict.SOLUTION, team="four", protocol="abt", runtime="simulator", seed=0))
    with pytest.raises(JournalError, match="expected the header"):
        read_journal(made(columns(lost)))
    assert "a second header" in str(read_journal(made(columns(HEADER), columns(HEADER))).damage)
    assert "there are entries after the end" in str(read_journal(made(columns(HEADER, ended), columns(lost))).damage)
    for first in ((HEADER, HEADER), (HEADER, ended, lost), (lost, HEADER), ()):
        with pytest.raises(JournalError):
            read_journal(made(columns(*first)))
    assert read_journal(made(columns(HEADER))).damage is None
    assert read_journal(made(columns(HEADER), columns())).events == ()


def test_what_no_message_can_hold_is_no_entry() -> None:
    for content in (
        {"x": msgspec.msgpack.Ext(1, b"")},
        {"x": {None: 1}},
        {"x": {(1, 2): 1}},
    ):
        parts = msgspec.msgpack.decode(columns(*run(0, 1)))
        parts[VALUES] = [content, *parts[VALUES][1:]]
        journal = read_journal(made(columns(HEADER), msgspec.msgpack.encode(parts)))
        assert journal.events == ()
        assert "has no valid entries" in str(journal.damage)


def test_deeply_nested_messages_are_no_entries() -> None:
    (parts,) = [msgspec.msgpack.decode(columns(*run(0, 1)))]
    parts[VALUES] = [msgspec.Raw(b"\x91" * 10**6 + b"\xc0")]
    assert "has no valid entries" in str(read_journal(made(columns(HEADER), msgspec.msgpack.encode(parts))).damage)


numbers = st.integers(-3, 3) | st.integers(-(2**63), 2**64 - 1)
scalars: st.SearchStrategy[Any] = st.none() | numbers | st.floats() | st.text(max_size=3) | st.binary(max_size=16)
anything = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=2), inner), max_leaves=6
)


@given(place=st.integers(0, 13), within=st.integers(0, 40), new=anything)
@examples(200)
@example(place=4, within=0, new=18_446_744_073_709_550_592)  # a time beyond 64 bits, in nanoseconds
def test_columns_that_were_altered_are_entries_or_refused(place: int, within: int, new: object) -> None:
    parts: list[Any] = msgspec.msgpack.decode(columns(*run(0, 3)))
    if within < 30 and isinstance(parts[place], list) and parts[place]:
        parts[place][within % len(parts[place])] = new
    else:
        parts[place] = new
    try:
        lines = entries_of(msgspec.msgpack.encode(parts))
    except BlockError:
        return
    text = msgspec.json.encode(lines)
    assert len(msgspec.json.decode(text, type=list[JournalEntry])) == len(lines)
    assert entries_of(columns_of(lines, exact=True))[:2] == lines[:2] or lines[:2] != lines[:2]  # NaN in a message
