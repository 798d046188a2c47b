"""Time limits for computations that look at no clock."""

from __future__ import annotations

import itertools
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

import pytest

from robochoc.system.signals import signals_delayed
from robochoc.system.time_limit import TimeLimitError, computed_by
from tests.support.limits import HANG_S

SOON_S = 0.02


def endless() -> int:
    return sum(0 for _ in itertools.count())


def endless_but_for_errors() -> None:
    """Drop an error once, as Python does with one in a destructor."""
    try:
        endless()
    except TimeLimitError:
        endless()


class Busy:
    """An object whose destructor takes longer than the time."""

    def __del__(self) -> None:
        until = time.monotonic() + 5 * SOON_S
        while time.monotonic() < until:
            pass


def endless_after_a_destructor() -> None:
    """Let the first error come in a destructor, where Python drops it."""
    Busy()
    endless()


def limited_within() -> None:
    """End a computation with a limit of its own, and go on."""
    with pytest.raises(TimeLimitError):
        computed_by(time.monotonic() + SOON_S / 2, endless)
    endless()


@pytest.mark.parametrize("function", [endless, endless_but_for_errors, endless_after_a_destructor, limited_within])
def test_a_computation_ends_with_its_time(function: Callable[[], object]) -> None:
    with pytest.raises(TimeLimitError):
        computed_by(time.monotonic() + SOON_S, function)


def test_a_computation_that_starts_too_late_does_not_start() -> None:
    with pytest.raises(TimeLimitError):
        computed_by(time.monotonic() - 1, pytest.fail, "it has started")


@pytest.mark.parametrize("deadline", [None, float("inf"), 1e300])
def test_a_result_in_time_is_returned(deadline: float | None) -> None:
    assert computed_by(deadline, sorted, [2, 1], reverse=True) == [2, 1]


def test_its_own_errors_are_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        computed_by(time.monotonic() + HANG_S, divmod, 1, 0)


def test_other_threads_compute_as_well() -> None:
    ended = []

    def compute() -> None:
        with pytest.raises(TimeLimitError):
            computed_by(time.monotonic() + SOON_S, endless)
        ended.append(True)

    threads = [threading.Thread(target=compute) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(HANG_S)
    assert len(ended) == len(threads)


def test_nothing_is_raised_where_signals_are_held() -> None:
    done = []

    def compute() -> None:
        with signals_delayed():
            end = time.monotonic() + 5 * SOON_S
            while time.monotonic() < end:
                pass
            done.append(True)
        endless()

    with pytest.raises(TimeLimitError):
        computed_by(time.monotonic() + SOON_S, compute)
    assert done


def test_an_import_is_never_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupted import would leave half a module behind."""
    (tmp_path / "slowly_imported.py").write_text(
        "import time\nfor _ in range(50):\n    time.sleep(0.01)\nwhole = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(TimeLimitError):
        computed_by(time.monotonic() + 0.1, _import_and_wait)
    assert sys.modules["slowly_imported"].whole


def _import_and_wait() -> None:
    import_module("slowly_imported")
    while True:
        pass


def test_nothing_is_raised_after_the_computation() -> None:
    """Many computations end when their time does: each has a result or an error, and what follows has no error."""

    def until(end: float) -> Iterator[int]:
        return itertools.takewhile(lambda _: time.monotonic() < end, itertools.count())

    for shift in range(60):
        deadline = time.monotonic() + 0.001
        try:
            assert computed_by(deadline, lambda end: sum(1 for _ in until(end)), deadline + (shift - 30) * 1e-5) >= 0
        except TimeLimitError:
            continue
    threading.Event().wait(0.1)
    assert sum(range(10_000)) == 49_995_000


def test_traced_functions_end_after_a_time_limit() -> None:
    """In Python up to 3.12, removing a pending error makes traced functions wait for ever. A process can be ended."""
    program = """
import sys, time
from robochoc.system.time_limit import TimeLimitError, computed_by
try:
    computed_by(time.monotonic() + 0.05, lambda: [time.sleep(0) for _ in iter(int, 1)])
except TimeLimitError:
    sys.setprofile(lambda *_: None)
    (lambda: None)()
    sys.setprofile(None)
    print("ended")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=HANG_S)
    assert (done.stdout, done.stderr) == ("ended\n", "")
