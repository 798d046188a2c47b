"""Functions applied in forked processes: the order of results, errors, the death of a process, and its end."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable

import pytest

from robochoc.system.parallel_map import ChildDiedError, ParallelMap
from robochoc.system.stopping import STOP, stop_handled, stop_requested
from tests.support.limits import wait_until


def square(number: int, report: Callable[[int], None]) -> int:
    report(number)
    if number < 0:
        raise ValueError(f"{number} is negative")
    return number * number


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_results_are_in_the_order_of_the_items(jobs: int) -> None:
    shown = []
    with ParallelMap(square, jobs, lambda done, progress: shown.append((done, progress))) as processes:
        assert [*processes.results(range(8))] == [(number, number**2) for number in range(8)]
    assert shown == sorted(shown)
    assert shown[-1] == (8, sum(range(8)))


@pytest.mark.parametrize("jobs", [1, 3])
def test_an_error_is_raised_in_place_of_the_result(jobs: int) -> None:
    with ParallelMap(square, jobs) as processes:
        results = processes.results([2, -1, 3])
        assert next(results) == (2, 4)
        with pytest.raises(ValueError, match="-1 is negative"):
            next(results)


def test_a_killed_process_is_an_error() -> None:
    def kill_itself(_: int, __: object) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    with ParallelMap(kill_itself, 2) as processes, pytest.raises(ChildDiedError, match="status -9"):
        next(processes.results([1]))


def test_all_processes_end_with_the_context() -> None:
    def wait_forever(_: int, report: Callable[[int], None]) -> None:
        report(os.getpid())
        signal.pause()

    pids: list[int] = []

    def show(_: int, pid: int) -> None:
        pids.append(pid)
        if pid:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), ParallelMap(wait_forever, 2, show) as processes:
        next(processes.results([1]))
    with pytest.raises(ProcessLookupError):
        os.kill(pids[-1], 0)


def test_a_stop_request_reaches_all_processes() -> None:
    def wait_for_stop(_: int, report: Callable[[int], None]) -> bool:
        report(1)
        wait_until(stop_requested, "no stop request")
        return stop_requested()

    def show(_: int, started: int) -> None:
        if started == 2 and not stop_requested():
            signal.raise_signal(STOP)

    with stop_handled(), ParallelMap(wait_for_stop, 2, show) as processes:
        assert [*processes.results([1, 2])] == [(1, True), (2, True)]
