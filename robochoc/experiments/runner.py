"""Runs a study: executes the missing runs, and compares and stores their answers."""

from __future__ import annotations

import itertools
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
from robochoc.system.posix import usable_processors

WRITE_S = 0.2
"""The interval between two writes of rows, in seconds. A killed study loses at most this time."""


class StudyProgress(NamedTuple):
    """The progress of a study.

    Attributes:
        done: The number of finished runs.
        planned: The number of all runs in the study.
        elapsed_s: The seconds since the study was started or continued.
        left_s: The estimated remaining seconds, based on the runs since then. None: there were no runs.
    """

    done: int
    planned: int
    elapsed_s: float
    left_s: float | None


class Workers(Protocol):
    """The workers that run tasks: processes on this machine, or a cluster."""

    def rows(self, bundles: Iterable[Sequence[Task]]) -> Iterator[tuple[Task, Row]]:
        """Yield the rows of all tasks in any order."""

    def __enter__(self) -> Self:
        """Start the workers."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        """End the workers."""


def run_study(
    study: Study,
    store: Store,
    jobs: int | None = None,
    *,
    progress: Callable[[StudyProgress], None] | None = None,
    workers: Callable[[int | None], Workers] | None = None,
    again: Collection[Status] = (),
) -> Counter[str]:
    """Execute the runs of `study` that are not in `store`.

    Runs in the simulator are executed in parallel. Afterwards, runs with processes are executed one at a time, since
    their times would be meaningless otherwise.

    Args:
        study: The study.
        store: The store for the results.
        jobs: The number of workers on this machine. None: the number of processors.
        progress: Called after each run.
        workers: Returns the workers for runs in the simulator, given a limit on memory in megabytes. None: processes
            on this machine.
        again: The statuses of runs to repeat, in addition to those that are always repeated.

    Returns:
        The number of the study's runs by status.

    Raises:
        DisagreementError: if two answers contradict each other, or the checker found one wrong. All rows so far are
            written.
        TooManyRunsError: if the study has too many runs.
    """
    plan = plan_of(study)
    there = store.start(study, plan, again)
    missing = [task for key, task in plan.items() if key not in there]
    agreement = Agreement()
    try:
        _compare_what_is_there(store, plan, agreement)
        with _Writer(store, agreement, _Clock(len(plan), len(missing), progress)) as writer:
            _run_all(missing, writer, jobs, workers)
    except DisagreementError as wrong:
        store.mark_stopped(str(wrong))
        raise
    store.check_place()
    return Counter(str(row["status"]) for row in store.results().rows)


def _run_all(
    missing: Sequence[Task], writer: _Writer, jobs: int | None, workers: Callable[[int | None], Workers] | None
) -> None:
    """Run the missing tasks, those with processes last."""
    for timed, tasks in itertools.groupby(sorted(missing, key=_is_timed), key=_is_timed):
        bundles = [[*bundle] for _, bundle in itertools.groupby(tasks, key=_problem)]
        memory_mb = bundles[0][0].limits.memory_mb
        if timed or workers is None:
            hands: Workers = LocalWorkers(1 if timed else jobs or usable_processors(), memory_mb)
        else:
            hands = workers(memory_mb)
        with hands:
            for task, row in hands.rows(bundles):
                writer.add(task, row)


def _is_timed(task: Task) -> bool:
    return task.is_timed


def _problem(task: Task) -> str:
    return task.problem.identity


class _Clock:
    """Measures and reports the progress."""

    def __init__(self, planned: int, missing: int, progress: Callable[[StudyProgress], None] | None) -> None:
        self._planned, self._missing = planned, missing
        self._progress = progress
        self._began = time.monotonic()
        self._run = 0

    def tick(self) -> None:
        """Count one finished run."""
        self._run += 1
        if self._progress:
            elapsed_s = time.monotonic() - self._began
            left = self._missing - self._run
            self._progress(StudyProgress(self._planned - left, self._planned, elapsed_s, elapsed_s / self._run * left))


def _compare_what_is_there(store: Store, plan: dict[str, Task], agreement: Agreement) -> None:
    """Compare the stored rows of earlier starts. Raises `DisagreementError`."""
    for found in store.results().rows:
        compared = {name: found[name] for name in ("team", "digest", "verdict", "withdrawn", "maximises", "reason")}
        cost = None if found["cost"] is None else str(found["cost"])
        row = Row(status=Status(found["status"]), cost=cost, **compared)
        agreement.add(plan[found["key"]], row)


class _Writer(AbstractContextManager["_Writer"]):
    """Writes several rows at a time, since writing each row could take longer than its run."""

    def __init__(self, store: Store, agreement: Agreement, clock: _Clock) -> None:
        self._store, self._agreement, self._clock = store, agreement, clock
        self._rows: list[tuple[str, Row]] = []
        self._due = 0.0

    def add(self, task: Task, row: Row) -> None:
        """Add a row, which is written now or soon. Raises `DisagreementError`."""
        self._rows.append((task.key, row))
        if time.monotonic() >= self._due:
            self.flush()
            self._due = time.monotonic() + WRITE_S
        self._clock.tick()
        self._agreement.add(task, row)

    def flush(self) -> None:
        """Write all waiting rows."""
        rows, self._rows = self._rows, []
        self._store.add(rows)

    def __exit__(self, *_: object) -> None:
        """Write the remaining rows."""
        self.flush()
