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
from distributed import CancelledError, Client, as_completed
from distributed.scheduler import KilledWorker

from robochoc.communication.arrays.cluster_client import SchedulerLostError, connect
from robochoc.experiments.remote_task import files_of, run_one
from robochoc.experiments.task import Row, Status, Task

AT_ONCE = 1000
"""The maximum number of tasks at the scheduler."""


class ClusterWorkers:
    """The workers on a Dask cluster.

    Args:
        address: The scheduler's address, such as `tcp://10.0.0.1:8786`. None: the address is in `file`.
        file: The scheduler's JSON file, as `dask scheduler --scheduler-file` and dask-jobqueue write it.
        memory_mb: Ignored: Dask's workers have their own memory limits.
        notice: Called once with a text if there are no workers yet.
    """

    def __init__(
        self,
        address: str | None,
        file: Path | None,
        memory_mb: int | None = None,
        notice: Callable[[str], object] | None = None,
    ) -> None:
        del memory_mb
        self._address, self._file, self._notice = address, file, notice
        self._client: Client | None = None

    def __enter__(self) -> Self:
        """Connect to the scheduler. Raises `SchedulerLostError` if it cannot be reached."""
        self._client = connect(self._address, self._file, "robochoc experiment")
        if self._notice and not self._client.scheduler_info()["workers"]:
            self._notice(f"the cluster at {self._file or self._address} has no workers yet; runs wait for them")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect from the scheduler, and discard waiting tasks."""
        if self._client is not None:
            self._client.close()

    def rows(self, bundles: Iterable[Sequence[Task]]) -> Iterator[tuple[Task, Row]]:
        """Yield the row of each task as soon as the task is finished."""
        client = self._client
        assert client is not None  # noqa: S101 - it is used as a context
        tasks = itertools.chain.from_iterable(bundles)
        running = {self._submit(client, task): task for task in itertools.islice(tasks, AT_ONCE)}
        completed = as_completed(list(running), loop=client.loop)
        for ended in completed:
            yield running.pop(ended), _row(ended)
            for task in itertools.islice(tasks, 1):
                future = self._submit(client, task)
                running[future] = task
                completed.add(future)

    def _submit(self, client: Client, task: Task) -> object:
        content = msgspec.json.encode(task)
        return client.submit(run_one, content, files_of(task), key=f"robochoc-{task.key}", pure=False)


def _row(future: object) -> Row:
    """Return the row of a finished or failed task."""
    try:
        return msgspec.json.decode(future.result(), type=Row)  # type: ignore[attr-defined]
    except CancelledError:
        raise SchedulerLostError("the scheduler of the cluster was lost: repeat the command to continue") from None
    except KilledWorker as killed:
        return Row(status=Status.CRASHED, reason=f"it killed workers of the cluster: {killed}")
    except Exception as error:  # noqa: BLE001 - any error of a cluster is one row
        return Row(status=Status.ERROR, reason=f"{type(error).__name__}: {error}")
