"""What a robot waits for."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import suppress

import pytest

from robochoc.communication.processes.robot_process import Action, DescriptorWatch
from robochoc.protocols.message import Envelope

Pipe = tuple[int, int]


@pytest.fixture
def pipe() -> Iterator[Pipe]:
    ends = os.pipe()
    yield ends
    for end in ends:
        with suppress(OSError):  # the test has closed it
            os.close(end)


def action() -> Action:
    def act(packet: list[Envelope]) -> None:
        raise AssertionError(packet)

    return act


def test_what_can_be_read_is_told_until_it_is_read(pipe: Pipe) -> None:
    watch, act = DescriptorWatch(), action()
    watch.add(pipe[0], act)
    assert watch.wait(0) == []
    os.write(pipe[1], b"something")
    assert watch.wait(None) == [act]
    assert watch.wait(0.0) == [act]
    os.read(pipe[0], 100)
    assert watch.wait(0.0) == []


def test_all_that_is_ready_comes_at_once() -> None:
    watch = DescriptorWatch()
    pipes = [os.pipe() for _ in range(40)]
    actions = [action() for _ in pipes]
    for (reader, writer), act in zip(pipes, actions, strict=True):
        watch.add(reader, act)
        os.write(writer, b"1")
    ready = watch.wait(None)
    for ends in pipes:
        for end in ends:
            os.close(end)
    assert set(map(id, ready)) == set(map(id, actions))
    assert len(ready) == len(actions)


def test_a_closed_end_can_be_read(pipe: Pipe) -> None:
    watch, act = DescriptorWatch(), action()
    watch.add(pipe[0], act)
    os.close(pipe[1])
    assert watch.wait(None) == [act]


def test_a_full_pipe_is_waited_for_and_one_without_a_reader_too(pipe: Pipe) -> None:
    reader, writer = pipe
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(4096))
    watch, act = DescriptorWatch(), action()
    watch.add(writer, act, write=True)
    assert watch.wait(0) == []
    os.read(reader, 1 << 16)
    assert watch.wait(None) == [act]
    os.close(reader)
    assert watch.wait(None) == [act]


def test_writing_is_watched_besides_reading() -> None:

    ours, theirs = socket.socketpair()
    with ours, theirs:
        watch, act = DescriptorWatch(), action()
        watch.add(ours.fileno(), act)
        watch.watch_writing(ours.fileno(), wanted=True)
        assert watch.wait(0) == [act]
        watch.watch_writing(ours.fileno(), wanted=False)
        assert watch.wait(0) == []
        theirs.send(b"1")
        assert watch.wait(None) == [act]


def test_what_is_removed_is_not_told(pipe: Pipe) -> None:
    watch = DescriptorWatch()
    watch.add(pipe[0], action())
    assert pipe[0] in watch
    os.write(pipe[1], b"1")
    watch.remove(pipe[0])
    assert pipe[0] not in watch
    assert None not in watch
    assert watch.wait(0) == []
