"""Processes that are forked: what they have, how they end, and that nothing of them stays."""

from __future__ import annotations

import gc
import os
import resource
import signal
import sys
from collections.abc import Callable
from itertools import pairwise
from multiprocessing.connection import wait

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.processes.forked_process import ForkedProcess, ranges_of
from robochoc.system.garbage import collection_paused, collection_seldom
from tests.support.cases import looped
from tests.support.leftovers import nothing_left_behind

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


def ended(act: Callable[[], None], *kept: int) -> int | None:
    """Run `act` in a process, and return its exit code; nothing of it is left."""
    with nothing_left_behind():
        process = ForkedProcess(act, kept)
        process.start()
        process.join()
        process.kill()  # of one that has ended: no error, and nobody else's process
        process.close()
    return process.exitcode


def fails() -> None:
    raise ValueError("no more ideas")


@looped(
    ("act", "exitcode"),
    [
        (lambda: None, 0),
        (lambda: sys.exit(5), 5),
        (sys.exit, 0),
        (lambda: sys.exit("bye"), 1),
        (lambda: os._exit(7), 7),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), -signal.SIGKILL),
        (fails, 1),
    ],
)
def test_it_ends_as_what_it_runs_ends(act: Callable[[], None], exitcode: int) -> None:
    assert ended(act) == exitcode


def test_the_garbage_collector_is_not_paused_as_in_another_thread() -> None:
    thresholds = gc.get_threshold()
    with collection_paused(), collection_seldom():
        assert ended(lambda: sys.exit(gc.isenabled() and gc.get_threshold() == thresholds)) == 1


def test_an_error_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    ended(fails)
    assert "ValueError: no more ideas" in capfd.readouterr().err


def test_what_is_printed_is_printed_once(capfd: pytest.CaptureFixture[str]) -> None:
    sys.stdout.write("before ")
    ended(lambda: print("and within"))  # noqa: T201 - that is what is tested
    assert capfd.readouterr().out == "before and within\n"


def test_it_does_not_read_its_parents_standard_input() -> None:
    read, write = os.pipe()
    os.write(write, b"for the parent")

    def parent() -> None:
        os.dup2(read, 0)
        sys.exit(ended(lambda: sys.exit(len(os.read(0, 1)))))

    assert ended(parent, read) == 0
    os.close(read)
    os.close(write)


def test_it_has_the_descriptors_that_it_inherits_but_for_those_it_is_to_close() -> None:
    read, write = os.pipe()
    others = [os.open(os.devnull, os.O_RDONLY) for _ in range(4)]

    def is_open(fd: int) -> bool:
        try:
            os.fstat(fd)
        except OSError:
            return False
        return True

    def tell() -> None:
        os.write(write, repr(sorted(filter(is_open, of_interest))).encode() + os.read(0, 1))

    process = ForkedProcess(tell, [write, others[1]], list(ranges_of([read, write, *others[:3]])))
    of_interest = {*others, read, write, *process.kept, process.sentinel}
    process.start()
    process.join()
    kept = {write, others[1], others[3], *process.kept, process.sentinel}
    assert os.read(read, 200) == repr(sorted(kept)).encode()
    assert process.exitcode == 0
    process.close()
    for fd in (read, write, *others):
        os.close(fd)


@given(st.sets(st.integers(0, 60)))
def test_ranges_have_all_descriptors_once(descriptors: set[int]) -> None:
    ranges = list(ranges_of(descriptors))
    assert [fd for one in ranges for fd in one] == sorted(descriptors)
    assert all(one.stop < next_one.start for one, next_one in pairwise(ranges))


def test_one_that_is_not_started_leaves_nothing() -> None:
    with nothing_left_behind():
        ForkedProcess(fails, ()).close()


def test_its_end_is_seen_and_not_before() -> None:
    read, write = os.pipe()

    def wait_for_the_end() -> None:
        os.read(read, 1)

    process = ForkedProcess(wait_for_the_end, [read], [range(write, write + 1)])
    process.start()
    os.close(read)
    os.set_blocking(process.sentinel, False)
    with pytest.raises(BlockingIOError):
        os.read(process.sentinel, 1)
    os.close(write)
    wait([process.sentinel])
    process.join()
    assert process.exitcode == 0
    process.close()


def test_it_looks_for_no_garbage_among_what_it_inherits() -> None:
    """To look is to write, and to write is to copy: it costs less than a quarter of the memory."""
    gc.collect()  # also empties the free lists that earlier tests have filled: the child would empty them
    many = [[number] for number in range(100_000)]
    pages = len(many) * sys.getsizeof(many[0]) // resource.getpagesize()
    read, write = os.pipe()

    def collect() -> None:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        gc.collect()
        os.write(write, str(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before).encode())

    assert ended(collect, write) == 0
    assert int(os.read(read, 20)) < pages / 4
    os.close(read)
    os.close(write)
