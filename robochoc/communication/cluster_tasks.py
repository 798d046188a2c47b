"""Tasks on the workers of a Dask cluster (https://distributed.dask.org). Extra: `cluster`.

If a worker is lost, Dask repeats its tasks on other workers.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

from distributed import CancelledError, Client, Future, get_worker

from robochoc.communication.cluster_client import SchedulerLostError, connect

Item = TypeVar("Item")
AT_ONCE = 1000
"""The maximum number of tasks at the scheduler."""
CHECK_S = 0.5
"""The longest interval between two calls of `tick`, in seconds."""


class ClusterTasks(Generic[Item]):
    """Runs one task for each item on the workers of a cluster. Leaving the context discards all other tasks.

    Args:
        place: The scheduler: see `connect`.
        name: The name of the client.
        notice: Called once with a text if there are no workers yet.
    """

    def __init__(self, place: str, name: str, notice: Callable[[str], object] | None = None) -> None:
        self._place, self._name, self._notice = place, name, notice

    def __enter__(self) -> Self:
        """Connect to the scheduler. Raises `SchedulerLostError` if it cannot be reached."""
        self.client: Client = connect(self._place, self._name)
        if self._notice and not self.client.scheduler_info()["workers"]:
            self._notice(f"the cluster at {self._place} has no workers yet; the tasks wait for them")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect from the scheduler, which discards all tasks."""
        self.client.close()

    def completed(
        self, items: Iterable[Item], submit: Callable[[Item], Future], tick: Callable[[], None] = lambda: None
    ) -> Iterator[tuple[Item, Future]]:
        """Yield each item with its task, as soon as the task is finished.

        Args:
            items: The items, which are read when their tasks are submitted.
            submit: Submits the task of an item to `client`.
            tick: Called from time to time.
        """
        finished = SimpleQueue[Future]()
        running: dict[Future, Item] = {}
        left = iter(items)

        def start(count: int) -> None:
            for item in itertools.islice(left, count):
                future = submit(item)
                running[future] = item
                future.add_done_callback(finished.put)

        start(AT_ONCE)
        while running:
            tick()
            try:
                ended = finished.get(timeout=CHECK_S)
            except Empty:
                continue
            yield running.pop(ended), ended
            start(1)


def result_of(future: Future) -> Any:  # noqa: ANN401 - the result of any task
    """Return the result of a finished task, or raise its error. Raises `SchedulerLostError` if it was cancelled."""
    try:
        return future.result()
    except CancelledError:
        raise SchedulerLostError("the scheduler of the cluster was lost: repeat the command") from None


def discarded_check() -> Callable[[], bool]:
    """Return a function by which the current task of this worker checks whether its result is no longer wanted."""
    worker = get_worker()
    key = worker.get_current_task()

    def is_discarded() -> bool:
        task = worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    return is_discarded
