"""The queues between processes: framing, full pipes, vanished ends, lying peers."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.processes.forked_process import ForkedProcess
from robochoc.communication.processes.queues import (
    LARGEST_BODY,
    CorruptQueueError,
    QueueReader,
    QueueWriter,
    Stamped,
    unpack,
    unpack_stamped,
)
from tests.support.cases import looped


@contextmanager
def opened_queue() -> Iterator[tuple[QueueReader, QueueWriter]]:
    read, write = os.pipe()
    reader, writer = QueueReader(read), QueueWriter(write)
    yield reader, writer
    reader.close()
    writer.close()


@pytest.fixture
def ends() -> Iterator[tuple[QueueReader, QueueWriter]]:
    with opened_queue() as ends:
        yield ends


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


@looped("length", [-1, LARGEST_BODY + 1, 2**31 - 1])
def test_an_absurd_length_is_refused_before_anything_is_allocated(length: int) -> None:
    buffer = bytearray(length.to_bytes(4, "big", signed=True) + b"x")
    with pytest.raises(CorruptQueueError):
        list(unpack(buffer))


# Stamped messages: what robots say to each other

STAMPED = st.lists(st.builds(Stamped, st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1), st.binary(max_size=300)))


def written(messages: list[Stamped]) -> bytes:
    """What stands in the pipe: lengths, epochs, clocks and contents."""
    sizes = (12 + len(message.content) for message in messages)
    return b"".join(
        size.to_bytes(4, "big") + epoch.to_bytes(4, "big") + clock.to_bytes(8, "big") + content
        for size, (epoch, clock, content) in zip(sizes, messages, strict=True)
    )


@given(messages=STAMPED, cuts=st.lists(st.integers(1, 50)))
def test_stamped_messages_survive_any_cutting_in_order(messages: list[Stamped], cuts: list[int]) -> None:
    stream = written(messages)
    read, write = os.pipe()
    reader = QueueReader(read)
    got: list[Stamped] = []
    for cut in [*cuts, len(stream)]:
        os.write(write, stream[:cut])
        stream = stream[cut:]
        got += reader.get_stamped()
    assert got == messages
    os.close(write)
    assert reader.get_stamped() == []
    assert reader.ended
    reader.close()


@given(messages=STAMPED)
def test_the_wire_form_is_that_of_bodies(messages: list[Stamped]) -> None:
    read, write = os.pipe()
    writer, reader = QueueWriter(write), QueueReader(read)
    for message in messages:
        writer.put_stamped(*message)
    got: list[bytes] = []
    while not writer.flush():
        got += reader.get_all()
    got += reader.get_all()
    buffer = bytearray(written(messages))
    assert got == list(unpack(buffer))
    writer.close()
    reader.close()


def test_many_small_messages_are_one_write_and_one_read(
    ends: tuple[QueueReader, QueueWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, writer = ends
    sizes: list[int] = []
    real = os.write

    def write(fd: int, data: bytes) -> int:
        sizes.append(len(data))
        return real(fd, data)

    monkeypatch.setattr(os, "write", write)
    messages = [Stamped(1, number, b"%d" % number) for number in range(200)]
    for message in messages:
        writer.put_stamped(*message)
    assert writer.flush()
    assert sizes == [len(written(messages))]
    assert reader.get_stamped() == messages


def test_a_large_message_comes_in_parts(ends: tuple[QueueReader, QueueWriter]) -> None:
    reader, writer = ends
    messages = [Stamped(2, 5, b"x" * 1_000_000), Stamped(2, 6, b"after it")]
    for message in messages:
        writer.put_stamped(*message)
    got: list[Stamped] = []
    while len(got) < len(messages):
        writer.flush()
        got += reader.get_stamped()
    assert got == messages


@looped("length", [-1, 0, 11, LARGEST_BODY + 1, 2**31 - 1])
def test_an_absurd_length_of_a_stamped_message_is_refused(length: int) -> None:
    frame = length.to_bytes(4, "big", signed=True) + bytes(12)
    with pytest.raises(CorruptQueueError):
        unpack_stamped(frame)
    with opened_queue() as (reader, writer):
        assert writer.fd is not None
        os.write(writer.fd, frame[:7])
        assert reader.get_stamped() == []
        os.write(writer.fd, frame[7:])
        with pytest.raises(CorruptQueueError):
            reader.get_stamped()


def test_of_a_writer_that_was_killed_between_two_parts_the_whole_messages_are_there() -> None:
    read, write = os.pipe()
    whole, large = Stamped(0, 1, b"whole"), Stamped(0, 2, b"x" * 1_000_000)

    def writes_and_waits() -> None:
        writer = QueueWriter(write)
        writer.put_stamped(*whole)
        writer.put_stamped(*large)
        assert not writer.flush()  # the pipe is full, and the rest waits
        time.sleep(1000)

    process = ForkedProcess(writes_and_waits, [write], [range(read, read + 1)])
    process.start()
    os.close(write)
    reader = QueueReader(read)
    got: list[Stamped] = []
    while not got:
        got = reader.get_stamped()
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    while not reader.ended:
        got += reader.get_stamped()
    assert got == [whole]
    process.join()
    process.close()
    reader.close()
