"""Time limits for computations that do not check the clock, such as preparation with many nested loops in Python.

Checks of the clock could be missing in a loop. So a second thread raises `TimeLimitError` in the computing thread at
any point, like Ctrl-C raises `KeyboardInterrupt`. The error is delayed while signals are (`system/signals.py`).
"""

from __future__ import annotations

import _thread
import sys
import threading
import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from robochoc.system.errors import RobochocError
from robochoc.system.signals import are_delayed

AGAIN_S = 0.05
"""The interval at which the error is raised again, in seconds, because Python drops exceptions in destructors."""
_LONGEST_WAIT_S = 1e6
"""The longest wait for a lock, in seconds."""

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class TimeLimitError(RobochocError):
    """Raised if the time limit of a computation was reached before its result."""


def computed_by(
    deadline: float | None, function: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Result:
    """Return the result of `function`, which must release its resources by `with` or `finally`.

    Args:
        deadline: The end of the time, on the monotonic clock. None: no limit.
        function: The computation.
        args: The arguments of `function`.
        kwargs: The keyword arguments of `function`.

    Raises:
        TimeLimitError: when the deadline has passed.
    """
    if deadline is None:
        return function(*args, **kwargs)
    if time.monotonic() >= deadline:
        raise TimeLimitError
    running, raising = _thread.allocate_lock(), _thread.allocate_lock()
    raised: list[float] = []
    running.acquire()
    # Python checks for an exception from another thread after a call, so `release` precedes the first check.
    try:
        _thread.start_new_thread(_watch, (threading.get_ident(), deadline, running, raising, raised))
        return function(*args, **kwargs)
    finally:
        try:
            running.release()
        finally:
            with raising:
                if raised:
                    _drop_pending_error()


def _watch(
    thread: int, deadline: float, running: _thread.LockType, raising: _thread.LockType, raised: list[float]
) -> None:
    """Raise `TimeLimitError` in a thread from the deadline on, until `running` is released."""
    while not running.acquire(timeout=min(max(AGAIN_S, deadline - time.monotonic()), _LONGEST_WAIT_S)):
        with raising:
            if running.locked() and not are_delayed(thread) and not _imports(thread) and time.monotonic() >= deadline:
                _ignore_where_dropped()
                raised.append(deadline)
                _raise_in(thread, TimeLimitError)


def _imports(thread: int) -> bool:
    """Return whether the computation in a thread is importing: an interrupted import leaves half a module behind."""
    frame = sys._current_frames().get(thread)  # noqa: SLF001 - documented
    while frame is not None and frame.f_code is not computed_by.__code__:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _ignore_where_dropped() -> None:
    """Keep Python from printing a `TimeLimitError` that it drops in a destructor or a callback."""
    before = sys.unraisablehook
    if getattr(before, "ignores_time_limits", False):
        return

    def print_others(dropped: sys.UnraisableHookArgs) -> None:
        if dropped.exc_type is not TimeLimitError:
            before(dropped)

    print_others.ignores_time_limits = True  # type: ignore[attr-defined]
    sys.unraisablehook = print_others


def _drop_pending_error() -> None:
    """Ensure that no pending `TimeLimitError` is raised later in this thread, by raising and catching another one.

    `PyThreadState_SetAsyncExc` can also remove the error. But then Python up to 3.12 checks for an error before each
    function from then on, which is slow, and never ends if functions are traced (`sys.setprofile`).
    """
    interruption: BaseException | None = None
    while True:
        try:
            _raise_in(threading.get_ident(), TimeLimitError)
            while True:
                time.sleep(0)
        except TimeLimitError:
            break
        except BaseException as error:  # noqa: BLE001 - Ctrl-C, raised again below
            interruption = error
    if interruption is not None:
        raise interruption


def _raise_in(thread: int, error: type[Exception]) -> None:
    """Raise an error in a thread."""
    import ctypes  # noqa: PLC0415 - start-up: few runs reach their time limit

    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(error))
