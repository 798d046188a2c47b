"""The queues between processes: framing, full pipes, vanished ends, lying peers."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.processes.queues import LARGEST_BODY, CorruptQueueError, QueueReader, QueueWriter, unpack


@pytest.fixture
def ends() -> Iterator[tuple[QueueReader, QueueWriter]]:
    read, write = os.pipe()
    reader, writer = QueueReader(read), QueueWriter(write)
    yield reader, writer
    reader.close()
    writer.close()


@given(bodies=st.lists(st.binary(max_size=300)), cuts=st.lists(st.integers(1, 50)))
def test_bodies_survive_any_cutting(bodies: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(len(body).to_bytes(4, "big") + body for body in bodies)
    buffer = bytearray()
    got: list[bytes] = []
    for cut in [*cuts, len(stream)]:
        buffer += stream[:cut]
        stream = stream[cut:]
        got += unpack(buffer)
    assert got == bodies
    assert not buffer


def test_what_is_put_comes_out_in_order(ends: tuple[QueueReader, QueueWriter]) -> None:
    reader, writer = ends
    for number in range(100):
        writer.put(b"%d" % number)
    assert writer.flush()
    assert reader.get_all() == [b"%d" % number for number in range(100)]
    assert reader.get_all() == []
    assert not reader.ended


def test_a_full_pipe_blocks_nobody_and_loses_nothing(ends: tuple[QueueReader, QueueWriter]) -> None:
    reader, writer = ends
    body = b"x" * 1_000_000
    writer.put(body)
    assert not writer.flush()
    got: list[bytes] = []
    while not got:
        got = reader.get_all()
        writer.flush()
    assert got == [body]
    assert writer.flush()


def test_a_queue_that_is_not_open_yet_keeps_what_is_put(ends: tuple[QueueReader, QueueWriter]) -> None:
    reader, _ = ends
    read, write = os.pipe()
    waiting, other = QueueWriter(), QueueReader(read)
    waiting.put(b"early")
    assert waiting.flush()
    waiting.open(write)
    assert waiting.flush()
    assert other.get_all() == [b"early"]
    assert reader.get_all() == []
    waiting.close()
    other.close()


def test_the_reader_sees_the_end() -> None:
    read, write = os.pipe()
    reader, writer = QueueReader(read), QueueWriter(write)
    writer.put(b"last words")
    writer.flush()
    writer.close()
    assert reader.get_all() == [b"last words"]
    assert reader.get_all() == []
    assert reader.ended
    reader.close()


def test_writing_to_nobody_is_no_error() -> None:
    read, write = os.pipe()
    writer = QueueWriter(write)
    os.close(read)
    writer.put(b"hello?")
    assert writer.flush()
    assert writer.broken
    writer.put(b"anybody?")
    assert writer.flush()
    writer.close()


@pytest.mark.parametrize("length", [-1, LARGEST_BODY + 1, 2**31 - 1])
def test_an_absurd_length_is_refused_before_anything_is_allocated(length: int) -> None:
    buffer = bytearray(length.to_bytes(4, "big", signed=True) + b"x")
    with pytest.raises(CorruptQueueError):
        list(unpack(buffer))
