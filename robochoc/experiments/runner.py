"""A study is carried out: what is not there yet is run, compared and written down."""

from __future__ import annotations

import itertools
import os
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from types import TracebackType
from typing import NamedTuple, Protocol, Self

from robochoc.experiments.agreement import Agreement, DisagreementError
from robochoc.experiments.plan import plan_of
from robochoc.experiments.store import Store
from robochoc.experiments.study import Study
from robochoc.experiments.task import Row, Status, Task
from robochoc.experiments.workers import LocalWorkers

WRITE_S = 0.2
"""Rows are written after so many seconds, together: what a kill costs at most."""


class StudyProgress(NamedTuple):
    """How far a study is.

    Attributes:
        done: The runs that are there.
        planned: All runs of the study.
        elapsed_s: Seconds since this start.
        left_s: How long the rest takes, by what was run since this start. None: nothing was.
    """

    done: int
    planned: int
    elapsed_s: float
    left_s: float | None


class Workers(Protocol):
    """What carries out tasks: processes of this machine, or a cluster."""

    def rows(self, bundles: Iterable[Sequence[Task]]) -> Iterator[tuple[Task, Row]]:
        """Yield what comes of all tasks, in any order."""

    def __enter__(self) -> Self:
        """Start what is needed."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        """End what was started."""


def run_study(
    study: Study,
    store: Store,
    jobs: int | None = None,
    *,
    progress: Callable[[StudyProgress], None] | None = None,
    workers: Callable[[int | None], Workers] | None = None,
    again: Collection[Status] = (),
) -> Counter[str]:
    """Run what `study` has and `store` has not.

    Runs in the simulator go on side by side. Those whose robots have processes come after them, one at a time, for
    their times would not be worth anything otherwise.

    Args:
        study: The study.
        store: Where the results are kept.
        jobs: How many workers this machine has. None: as many as it has processors.
        progress: It is called after each run.
        workers: Returns what carries out runs in the simulator, instead of this machine; it is given the limit on
            memory in megabytes.
        again: How runs have ended that are made again, besides those that always are.

    Returns:
        How many of the study's runs have which status.

    Raises:
        DisagreementError: if two answers contradict each other, or one is refuted. All rows so far are written.
        TooManyRunsError: if the study has too many runs.
    """
    plan = plan_of(study)
    there = store.begin(study, plan, again)
    missing = [task for key, task in plan.items() if key not in there]
    agreement = Agreement()
    try:
        _compare_what_is_there(store, plan, agreement)
        with _Writer(store, agreement, _Clock(len(plan), len(missing), progress)) as writer:
            _run_all(missing, writer, jobs, workers)
    except DisagreementError as wrong:
        store.stop(str(wrong))
        raise
    store.check_place()
    return Counter(str(row["status"]) for row in store.results().rows)


def _run_all(
    missing: Sequence[Task], writer: _Writer, jobs: int | None, workers: Callable[[int | None], Workers] | None
) -> None:
    """Run the missing tasks, those of processes after the others."""
    for timed, tasks in itertools.groupby(sorted(missing, key=_is_timed), key=_is_timed):
        bundles = [[*bundle] for _, bundle in itertools.groupby(tasks, key=_problem)]
        memory_mb = bundles[0][0].limits.memory_mb
        if timed or workers is None:
            hands: Workers = LocalWorkers(1 if timed else jobs or _processors(), memory_mb)
        else:
            hands = workers(memory_mb)
        with hands:
            for task, row in hands.rows(bundles):
                writer.take(task, row)


def _is_timed(task: Task) -> bool:
    return task.is_timed


def _problem(task: Task) -> str:
    return task.problem.identity


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Clock:
    """Tells the progress."""

    def __init__(self, planned: int, missing: int, progress: Callable[[StudyProgress], None] | None) -> None:
        self._planned, self._missing = planned, missing
        self._progress = progress
        self._began = time.monotonic()
        self._run = 0

    def tick(self) -> None:
        """Count a run."""
        self._run += 1
        if self._progress:
            elapsed_s = time.monotonic() - self._began
            left = self._missing - self._run
            self._progress(StudyProgress(self._planned - left, self._planned, elapsed_s, elapsed_s / self._run * left))


def _compare_what_is_there(store: Store, plan: dict[str, Task], agreement: Agreement) -> None:
    """Compare the rows of earlier starts. Raises `DisagreementError`."""
    for found in store.results().rows:
        compared = {name: found[name] for name in ("team", "digest", "verdict", "withdrawn", "maximises", "reason")}
        cost = None if found["cost"] is None else str(found["cost"])
        row = Row(status=Status(found["status"]), cost=cost, **compared)
        agreement.add(plan[found["key"]], row)


class _Writer(AbstractContextManager["_Writer"]):
    """Writes rows, several at a time: they come faster than a disk can be asked to keep each."""

    def __init__(self, store: Store, agreement: Agreement, clock: _Clock) -> None:
        self._store, self._agreement, self._clock = store, agreement, clock
        self._rows: list[tuple[str, Row]] = []
        self._due = 0.0

    def take(self, task: Task, row: Row) -> None:
        """Write a row, now or soon. Raises `DisagreementError`."""
        self._rows.append((task.key, row))
        if time.monotonic() >= self._due:
            self.flush()
            self._due = time.monotonic() + WRITE_S
        self._clock.tick()
        self._agreement.add(task, row)

    def flush(self) -> None:
        """Write what is waiting."""
        rows, self._rows = self._rows, []
        self._store.add(rows)

    def __exit__(self, *_: object) -> None:
        """Write what is left."""
        self.flush()
