"""The fixture that looks for what tests leave behind finds it."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support import leftovers

Leave = Callable[[ExitStack], None]
"""Leaves something behind, and says to the stack how it is removed."""


def a_thread(stack: ExitStack) -> None:
    end = threading.Event()
    thread = threading.Thread(target=end.wait, name="lazy")
    thread.start()
    stack.callback(thread.join)
    stack.callback(end.set)


def a_process(stack: ExitStack) -> None:
    process = stack.enter_context(subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE))
    stack.callback(process.kill)


def a_port(stack: ExitStack) -> None:
    stack.enter_context(socket.create_server(("127.0.0.1", 0)))


def a_file(stack: ExitStack) -> None:
    descriptor, name = tempfile.mkstemp("-forgotten")  # what was shared once is so for good: another name each time
    os.close(descriptor)
    stack.callback(Path(name).unlink)


@pytest.mark.parametrize(
    ("leave", "told"),
    [
        (a_thread, "thread lazy"),
        (a_process, r"process \d+: .*input"),
        (a_port, "descriptor socket"),
        (a_file, "file .*forgotten"),
    ],
)
def test_what_is_left_is_told(leave: Leave, told: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leftovers, "WITHIN_S", 0.0)
    with (
        ExitStack() as stack,
        pytest.raises(AssertionError, match=f"left behind: .*{told}"),
        leftovers.nothing_left_behind(),
    ):
        leave(stack)


@pytest.mark.parametrize("begin", [a_thread, a_process, a_port, a_file])
def test_what_is_shared_is_not_left(begin: Leave, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leftovers, "WITHIN_S", 0.0)
    with ExitStack() as stack, leftovers.nothing_left_behind(), leftovers.shared_by_tests():
        begin(stack)


def test_a_link_that_was_opened_anew_is_not_left_and_one_more_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a run that tests share does after an outage is no fault of the test in which it happens."""
    monkeypatch.setattr(leftovers, "WITHIN_S", 0.0)
    with ExitStack() as stack:
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        shared = stack.enter_context(socket.create_connection(listener.getsockname()))
        with leftovers.nothing_left_behind():
            anew = stack.enter_context(socket.create_connection(listener.getsockname()))
            assert os.fstat(anew.fileno()).st_ino != os.fstat(shared.fileno()).st_ino
            shared.close()
        with (
            pytest.raises(AssertionError, match=r"left behind: .*socket: tcp link with 0100007F:.*, number 2"),
            leftovers.nothing_left_behind(),
        ):
            stack.enter_context(socket.create_connection(listener.getsockname()))


def test_a_process_that_has_left_the_family_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its parent has ended, so it is nobody's child; but it has the mark of the tests."""
    monkeypatch.setattr(leftovers, "WITHIN_S", 0.0)
    command = [sys.executable, "-c", "import os, sys; os.fork() or sys.stdin.read()"]
    environment = {**os.environ, leftovers.MARK: "mine"}
    look = leftovers.no_process_left("mine")
    look.__enter__()
    parent = subprocess.Popen(command, stdin=subprocess.PIPE, env=environment)
    parent.wait()
    with pytest.raises(AssertionError, match=r"left behind: .*os\.fork"):
        look.__exit__(None, None, None)
    assert parent.stdin
    parent.stdin.close()  # it ends when it has nothing more to read
