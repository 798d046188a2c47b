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
from types import SimpleNamespace

import pytest

from tests.support import leftovers
from tests.support.leftovers import LeftoversOfFile

Leave = Callable[[ExitStack], None]
"""Leaves something behind, and says to the stack how it is removed."""


def a_thread(stack: ExitStack) -> None:
    end = threading.Event()
    thread = threading.Thread(target=end.wait, name="lazy")
    thread.start()
    stack.callback(thread.join)
    stack.callback(end.set)


def a_process(stack: ExitStack) -> None:
    command = [sys.executable, "-c", "print(flush=True); input()"]
    process = stack.enter_context(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE))
    stack.callback(process.kill)
    assert process.stdout
    process.stdout.readline()  # for a moment after its start the system does not know its command line


def a_port(stack: ExitStack) -> None:
    stack.enter_context(socket.create_server(("127.0.0.1", 0)))


def a_file(stack: ExitStack) -> None:
    descriptor, name = tempfile.mkstemp("-forgotten")  # what was shared once is so for good: another name each time
    os.close(descriptor)
    stack.callback(Path(name).unlink)


@pytest.fixture(autouse=True)
def garbage(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Wait for nothing, and note in place of a search for garbage, which takes long in a process of many tests."""
    searches: list[object] = []
    monkeypatch.setattr(leftovers, "WITHIN_S", 0.0)
    monkeypatch.setattr(leftovers, "gc", SimpleNamespace(collect=lambda *generation: searches.append(generation)))
    return searches


LEAVE = {
    a_thread: "thread lazy",
    a_process: r"process \d+: .*input",
    a_port: "descriptor socket",
    a_file: "file .*forgotten",
}


@pytest.mark.parametrize(("leave", "name"), LEAVE.items())
def test_leftovers_of_a_test_are_named(leave: Leave, name: str, garbage: list[object]) -> None:
    of_file = LeftoversOfFile("nothing")
    with of_file.of_test():
        pass
    with ExitStack() as stack:
        with pytest.raises(AssertionError, match=f"left behind: .*{name}"), of_file.of_test():
            leave(stack)
        with pytest.raises(AssertionError, match=f"left behind by a test of this file: .*{name}"):
            of_file.check()
        LeftoversOfFile(name.partition(" ")[0]).check()
    assert garbage == [(1,), ()] * 2
    with of_file.of_test():
        pass
    of_file.check()


@pytest.mark.parametrize("begin", LEAVE)
def test_shared_things_are_no_leftovers(begin: Leave) -> None:
    of_file = LeftoversOfFile("nothing")
    with ExitStack() as stack:
        with of_file.of_test(), leftovers.shared_by_tests():
            begin(stack)
        of_file.check()


def test_a_fixture_of_several_tests_is_no_leftover_of_the_first() -> None:
    of_file = LeftoversOfFile("nothing")
    with ExitStack() as stack:
        a_port(stack)
        with of_file.of_test():
            pass
        with pytest.raises(AssertionError, match=r"left behind: .*thread lazy"), of_file.of_test():
            a_thread(stack)


def test_a_descriptor_in_place_of_another_is_found_at_the_end_of_the_file(tmp_path: Path) -> None:
    with (tmp_path / "before").open("w") as file:
        of_file = LeftoversOfFile("nothing")
        with of_file.of_test(), (tmp_path / "after").open("w") as other:
            os.dup2(other.fileno(), file.fileno())
        with pytest.raises(AssertionError, match=r"left behind by a test of this file: .*descriptor .*/after"):
            of_file.check()


def test_a_link_that_was_opened_anew_is_not_left_and_one_more_is() -> None:
    """What a run that tests share does after an outage is no fault of the test in which it happens."""
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


def test_a_process_that_has_left_the_family_is_found() -> None:
    """Its parent has ended, so it is nobody's child; but it has the mark of the tests."""
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
