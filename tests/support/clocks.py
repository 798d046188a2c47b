"""Limits of time that a busy machine does not break.

A test that says "this takes at most a second" is about the program, not about the machine it runs on. What computes is
measured in the processor's time. What waits is measured by the clock on the wall, but for the stretches in which the
whole machine stood still: virtual machines are known to stop for more than a minute.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

R = TypeVar("R")

LIMITS_S = (1.5, 6, 20, 60)
"""Until one of them something has been found, however busy the machine is."""
TICK_S = 0.02
LATE_S = 0.1
"""A tick that comes so late has not been late by chance."""


@contextmanager
def working(at_most_s: float) -> Iterator[None]:
    """What is done inside takes at most so many seconds of the processor, all threads together."""
    began = time.process_time()
    yield
    took = time.process_time() - began
    assert took < at_most_s, f"{took:.2f} s of the processor"


@contextmanager
def waiting(at_most_s: float, at_least_s: float = 0.0) -> Iterator[None]:
    """What is done inside takes at most so many seconds in which the machine runs, and at least so many in all."""
    began = time.monotonic()
    with standstill() as stood:
        yield
    took = time.monotonic() - began
    assert took >= at_least_s, f"{took:.2f} s"
    assert took - stood[0] < at_most_s, f"{took:.2f} s, of which the machine stood still for {stood[0]:.2f} s"


def once(found: Callable[[R], bool], ask: Callable[[float], R]) -> R:
    """What is said when the first of the limits is over by which something was found."""
    for limit in LIMITS_S:
        said = ask(limit)
        if found(said):
            break
    return said


@contextmanager
def standstill() -> Iterator[list[float]]:
    """Yield a list of one number: the seconds, so far, in which neither this process ran nor could its clock tick.

    A tick that is late because the process itself computes does not count: it may hold the interpreter's lock.
    """
    stood, over = [0.0], threading.Event()

    def tick() -> None:
        seen, worked = time.monotonic(), time.process_time()
        while not over.wait(TICK_S):
            now, works = time.monotonic(), time.process_time()
            late = (now - seen) - TICK_S - (works - worked)
            if late > LATE_S:
                stood[0] += late
            seen, worked = now, works

    clock = threading.Thread(target=tick, daemon=True)
    clock.start()
    try:
        yield stood
    finally:
        over.set()
        clock.join()
