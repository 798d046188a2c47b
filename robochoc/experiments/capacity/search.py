"""Finds the largest size that is solved in time: sizes are doubled up to a limit, then the interval is halved."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

import msgspec

from robochoc.communication.search_result import Progress
from robochoc.experiments.capacity.growth import Growth
from robochoc.experiments.capacity.measurement import Limit, Step, available_bytes, measured
from robochoc.formats.diagnostics import InvalidInputError, on_one_line, shortened
from robochoc.run.options import Options
from robochoc.system.posix import usable_processors

_PRECISION = 10
"""The interval is halved until it is shorter than its lower end divided by this number."""
_MEMORY_SHARE = 0.9
"""The share of the available memory that a size may need by estimate."""


class Capacity(msgspec.Struct, frozen=True):
    """The result of measuring a problem's sizes.

    Attributes:
        grown: A sentence that says what was grown.
        protocol: The protocol, as given.
        runtime: The runtime.
        deadline_s: The longest time for a decision, in seconds.
        processors: The number of processors.
        robots: The largest number of robots whose decisions were all made in time; 0: the given problem is too large.
        limit: The limit of the next larger size that was tried; None: none was met.
        why: A sentence about this limit.
        steps: The measurements, in the order of their sizes.
    """

    grown: str
    protocol: str
    runtime: str
    deadline_s: float
    processors: int
    robots: int
    limit: Limit | None
    why: str
    steps: tuple[Step, ...]


def find_capacity(
    growth: Growth,
    options: Options,
    *,
    deadline_s: float,
    timeout_s: float,
    progress: Callable[[Progress], None] | None = None,
    report: Callable[[Step], None] = lambda _: None,
) -> Capacity:
    """Return the largest size of `growth` whose decisions are made in time, with all measurements.

    Args:
        growth: The problem and how it grows.
        options: The options of each run; its seed and timeout are replaced.
        deadline_s: The longest time for a decision, in seconds; at least `DEADLINE_MIN_S`.
        timeout_s: The longest time for all measurements, in seconds. A decision that has begun ends by then.
        progress: Receives the number of messages of the present run.
        report: Receives each measurement.

    Raises:
        InvalidInputError: the given problem is not valid.
        UnsupportedError: the given problem is not supported by the protocol or the runtime.
    """
    until_s = time.monotonic() + timeout_s
    # The first decision of a program takes longer: modules and solvers are loaded.
    measured(1, growth.team_at(1), options, timeout_s / 2, time.monotonic() + timeout_s / 2, progress, repeats=1)
    steps: list[Step] = []
    for size in _sizes(growth, steps):
        step = _too_large(size, steps)
        if step is None:
            try:
                team = growth.team_at(size)
            except InvalidInputError as invalid:  # such as a task list with too many entries
                if size == 1:
                    raise
                step = Step(size, 0, 0, limit=Limit.PROBLEM, why=shortened(on_one_line(str(invalid))))
            else:
                step = measured(size, team, options, deadline_s, until_s, progress)
        steps.append(step)
        report(step)
        if step.limit == Limit.TIME:
            break
    solved = [one for one in steps if one.limit is None]
    failed = [one for one in steps if one.limit is not None]
    first = min(failed, key=lambda one: one.size, default=None)
    return Capacity(
        growth.text,
        options.protocol,
        options.runtime.value,
        deadline_s,
        usable_processors(),
        robots=max((one.robots for one in solved), default=0),
        limit=first.limit if first else None,
        why=first.why if first else "",
        steps=tuple(sorted(steps, key=lambda one: one.size)),
    )


def _sizes(growth: Growth, steps: Sequence[Step]) -> Iterator[int]:
    """Yield the sizes to measure; `steps` has the measurements so far."""
    if growth.given is not None:
        for size in range(1, growth.given + 1):
            if _all_solved(steps):
                yield size
        return
    size = 1
    while _all_solved(steps):
        yield size
        size *= 2
    low, high = size // 4, size // 2
    while high - low > max(1, low // _PRECISION):
        middle = (low + high) // 2
        yield middle
        low, high = (middle, high) if steps[-1].limit is None else (low, middle)


def _all_solved(steps: Sequence[Step]) -> bool:
    return all(step.limit is None for step in steps)


def _too_large(size: int, steps: list[Step]) -> Step | None:
    """Return a step with the limit `MEMORY` if the processes of this size would need more memory than is available."""
    before = max((one for one in steps if one.limit is None), key=lambda one: one.size, default=None)
    free = available_bytes()
    if before is None or free is None or before.robot_bytes == 0:
        return None
    robots = before.robots * size // before.size
    needed = robots * before.robot_bytes
    if needed <= free * _MEMORY_SHARE:
        return None
    why = (
        f"{robots:,} processes of {before.robot_bytes >> 20} MiB would need more than the available {free >> 20:,} MiB"
    )
    return Step(size, robots, before.variables * size // before.size, limit=Limit.MEMORY, why=why)
