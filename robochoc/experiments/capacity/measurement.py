"""Measures one size of a grown problem: decisions and messages per second, memory, CPU time, and the limit met."""

from __future__ import annotations

import errno
import resource
import time
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from statistics import median

import msgspec

from robochoc.communication.network.framing import MessageTooLargeError
from robochoc.communication.resources import read_text
from robochoc.communication.search_result import Progress, RobotsLostError
from robochoc.formats.diagnostics import on_one_line
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.run.options import Options
from robochoc.run.orchestrator import solve
from robochoc.solver.compile import CompileTimeoutError, TeamCompileTimeoutError
from robochoc.solver.compiled_domain import TooManySolutionsError
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.system.posix import usable_processors

BUSY = 0.8
"""The fraction of all processors' time from which on the processors are the limit."""
REPEATS_MAX = 5
DEADLINE_MIN_S = 0.01
"""The shortest deadline, in seconds: measurements of shorter times are not reliable."""


class Limit(StrEnum):
    """The reason why a larger team is not solved."""

    CPU = "CPU"
    DEADLINE = "the deadline"
    MEMORY = "memory"
    DESCRIPTORS = "file descriptors"
    PROCESSES = "processes"
    PROBLEM = "the problem"
    TIME = "the time for measuring"


_SYSTEM_LIMITS = {
    errno.EAGAIN: Limit.PROCESSES,
    errno.EMFILE: Limit.DESCRIPTORS,
    errno.ENFILE: Limit.DESCRIPTORS,
    errno.ENOMEM: Limit.MEMORY,
}


_TOO_LARGE = (TooLargeError, MessageTooLargeError)


class Step(msgspec.Struct, frozen=True):
    """The measurements of one size.

    Attributes:
        size: The number of copies, or the number of the given problem.
        robots: The number of robots.
        variables: The number of variables.
        decisions: The number of decisions measured.
        decision_s: The median time of a decision in seconds, from the team to the checked answer.
        decisions_per_s: The number of decisions per second.
        messages_per_s: The number of protocol messages per second of search.
        messages: The number of protocol messages of a decision, on average.
        robot_bytes: The private memory of the largest robot process; 0 if robots have no processes.
        cpu: The fraction of all processors' time that was used, 0 to 1.
        limit: The limit that was met; None: all decisions were made in time.
        why: A sentence about the limit; empty: no limit was met.
    """

    size: int
    robots: int
    variables: int
    decisions: int = 0
    decision_s: float = 0.0
    decisions_per_s: float = 0.0
    messages_per_s: float = 0.0
    messages: float = 0.0
    robot_bytes: int = 0
    cpu: float = 0.0
    limit: Limit | None = None
    why: str = ""


class _Sums:
    """The sums over the decisions of a step."""

    def __init__(self) -> None:
        self.times_s: list[float] = []
        self.outcomes: list[Outcome] = []
        self._cpu_s, self.began_s = cpu_seconds(), time.monotonic()
        self._processor_times = processor_times()

    def add(self, outcome: Outcome, took_s: float) -> None:
        self.outcomes.append(outcome)
        self.times_s.append(took_s)

    def step(self, size: int, team: Team, limit: Limit | None, why: str) -> Step:
        wall_s = max(time.monotonic() - self.began_s, 1e-9)
        search_s = sum(one.metrics.wall_s for one in self.outcomes)
        messages = sum(sum(one.metrics.messages.values()) for one in self.outcomes)
        used = (cpu_seconds() - self._cpu_s) / wall_s / usable_processors()
        count = len(self.times_s)
        return Step(
            size,
            len(team.order),
            len(team.variables),
            decisions=count,
            decision_s=median(self.times_s) if count else wall_s,
            decisions_per_s=count / sum(self.times_s) if count else 0.0,
            messages_per_s=messages / search_s if search_s else 0.0,
            messages=messages / count if count else 0.0,
            robot_bytes=max((one.metrics.memory for one in self.outcomes), default=0),
            cpu=min(used, 1.0),
            limit=Limit.CPU if limit == Limit.DEADLINE and max(used, self._share_of_all_programs()) >= BUSY else limit,
            why=why,
        )

    def _share_of_all_programs(self) -> float:
        """Return the fraction of all processors' time used by all programs, with those of other users."""
        (busy, idle), (busy_before, idle_before) = processor_times(), self._processor_times
        return (busy - busy_before) / max(busy - busy_before + idle - idle_before, 1)


def measured(
    size: int,
    team: Team,
    options: Options,
    deadline_s: float,
    until_s: float,
    progress: Callable[[Progress], None] | None = None,
    *,
    repeats: int = REPEATS_MAX,
) -> Step:
    """Return the measurements of `team`.

    Args:
        size: The size of the problem, for the result.
        team: The team.
        options: The options of each run; the seed and the timeout are replaced.
        deadline_s: The longest time for a decision, in seconds; at least `DEADLINE_MIN_S`.
        until_s: The time of `time.monotonic` at which measuring ends.
        progress: Receives the number of messages of the present run.
        repeats: The largest number of decisions.

    Raises:
        UnsupportedError: the given problem (size 1) is not supported, so its size is not the reason.
    """
    sums = _Sums()
    enough_s = sums.began_s + (until_s - sums.began_s) / 4
    for repeat in range(repeats):
        began_s = time.monotonic()
        if began_s > (enough_s if repeat else until_s):
            break
        allowed_s = max(min(deadline_s, until_s - began_s), DEADLINE_MIN_S)
        run = replace(options, seed=options.seed + repeat, timeout=allowed_s)
        found = _solved(team, run, progress, is_given=size == 1)
        took_s = time.monotonic() - began_s
        if isinstance(found, Outcome) and took_s <= deadline_s:
            sums.add(found, took_s)
            continue
        limit, why = (Limit.DEADLINE, "") if isinstance(found, Outcome) else found
        if limit == Limit.DEADLINE:
            is_short = allowed_s < deadline_s
            limit = Limit.TIME if is_short else limit
            why = f"no decision within {allowed_s:.2g} s{', the time that was left' if is_short else ''}"
        return sums.step(size, team, limit, why)
    if not sums.times_s:
        return sums.step(size, team, Limit.TIME, "no time was left to measure this size")
    return sums.step(size, team, None, "")


def _solved(
    team: Team, options: Options, progress: Callable[[Progress], None] | None, *, is_given: bool
) -> Outcome | tuple[Limit, str]:
    """Return the outcome of a decision, or the limit that prevented it and a sentence about it.

    If the team `is_given`, not grown, an `UnsupportedError` that is not about its size is raised.
    """
    try:
        outcome = solve(team, options, progress=progress)
    except (CompileTimeoutError, TeamCompileTimeoutError):
        return Limit.DEADLINE, ""
    except MemoryError:
        return Limit.MEMORY, "a process had no memory left"
    except OSError as error:
        if error.errno not in _SYSTEM_LIMITS:
            raise
        return _SYSTEM_LIMITS[error.errno], f"the system refused: {error.strerror}"
    except (UnsupportedError, TooManySolutionsError, RobotsLostError) as error:
        text = str(error)
        is_descriptors = "open files" in text
        if is_given and isinstance(error, UnsupportedError) and not (is_descriptors or isinstance(error, _TOO_LARGE)):
            raise
        return (Limit.DESCRIPTORS if is_descriptors else Limit.PROBLEM), on_one_line(text)
    return (Limit.DEADLINE, "") if outcome.verdict == Verdict.UNKNOWN else outcome


def cpu_seconds() -> float:
    """Return the CPU time of this process and its ended children, in seconds."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def processor_times() -> tuple[int, int]:
    """Return the busy and the idle time of all processors since the start of the system, in the system's ticks.

    Both are 0 if the system does not report them.
    """
    ticks = [int(word) for word in read_text("/proc/stat").partition("\n")[0].split()[1:]]
    idle = sum(ticks[3:5])  # and waiting for disks
    return sum(ticks) - idle, idle


def available_bytes() -> int | None:
    """Return the memory that new processes may use, in bytes; None if the system does not report it."""
    for line in read_text("/proc/meminfo").splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    return None
