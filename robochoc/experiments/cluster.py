"""Workers on a Dask cluster (https://distributed.dask.org). Extra: `cluster`.

Each run is one task for the cluster. Tasks and rows are sent as JSON, together with the files of teams, so workers need
robochoc but no shared folder. If a worker is lost, other workers repeat its tasks. Dask itself unpickles received data,
so only users who may run programs on the cluster should be able to reach the scheduler.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec
from distributed import Future
from distributed.scheduler import KilledWorker

from robochoc.communication.cluster_client import SchedulerLostError
from robochoc.communication.cluster_tasks import ClusterTasks, result_of
from robochoc.experiments.remote_task import files_of, run_one
from robochoc.experiments.task import Row, Status, Task


class ClusterWorkers:
    """The workers on a Dask cluster.

    Args:
        place: The scheduler's address, or the path of its file: see `connect`.
        memory_mb: Ignored: Dask's workers have their own memory limits.
        notice: Called once with a text if there are no workers yet.
    """

    def __init__(self, place: str, memory_mb: int | None = None, notice: Callable[[str], object] | None = None) -> None:
        del memory_mb
        self._tasks = ClusterTasks[Task](place, "robochoc experiment", notice)

    def __enter__(self) -> Self:
        """Connect to the scheduler. Raises `SchedulerLostError` if it cannot be reached."""
        self._tasks.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect from the scheduler, and discard waiting tasks."""
        self._tasks.__exit__(kind, error, trace)

    def rows(self, bundles: Iterable[Sequence[Task]]) -> Iterator[tuple[Task, Row]]:
        """Yield the row of each task as soon as the task is finished."""
        for task, ended in self._tasks.completed(itertools.chain.from_iterable(bundles), self._submit):
            yield task, _row(ended)

    def _submit(self, task: Task) -> Future:
        content = msgspec.json.encode(task)
        path = task.problem.path
        files = files_of(Path(path)) if path else {}
        return self._tasks.client.submit(run_one, content, files, key=f"robochoc-{task.key}", pure=False)


def _row(future: Future) -> Row:
    """Return the row of a finished or failed task."""
    try:
        return msgspec.json.decode(result_of(future), type=Row)
    except SchedulerLostError:
        raise
    except KilledWorker as killed:
        return Row(status=Status.CRASHED, reason=f"it killed workers of the cluster: {killed}")
    except Exception as error:  # noqa: BLE001 - any error of a cluster is one row
        return Row(status=Status.ERROR, reason=f"{type(error).__name__}: {error}")
