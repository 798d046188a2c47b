"""Explores teams on the workers of a Dask cluster, one task for each team. Extra: `cluster`.

Workers that are asked to stop return the states explored so far. If the program that asked is gone, they stop as well.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterable
from contextlib import suppress

from distributed import Event, Future
from distributed.scheduler import KilledWorker

from robochoc.communication.cluster_tasks import ClusterTasks, discarded_check, result_of
from robochoc.communication.search_result import ClusterLostError
from robochoc.exploration.check import Case, CheckOptions, Explored, case_of, explore
from robochoc.exploration.team_state import Exploration
from robochoc.model.problem import Team
from robochoc.system.errors import RobochocError

POLL_S = 1.0
"""The interval at which a worker checks that it should continue, in seconds."""


def explored_on_cluster(
    place: str,
    teams: Iterable[tuple[Team, Case]],
    options: CheckOptions,
    is_over: Callable[[], bool],
    show: Callable[[int, int], None] | None,
    notice: Callable[[str], object] | None,
) -> Explored:
    """Yield each team with what was explored, in the order of the teams.

    Args:
        place: The cluster's scheduler: see `cluster_client.connect`.
        teams: The teams, each with its case.
        options: How to check.
        is_over: Asked from time to time whether the workers must stop.
        show: Called with the number of explored teams, and of their states.
        notice: Called once with a text if there are no workers yet.

    Raises:
        ClusterLostError: if the scheduler is lost, or a team has killed several workers.
    """
    with ClusterTasks[tuple[int, tuple[Team, Case]]](place, "robochoc check", notice) as tasks:
        stop = Event(f"robochoc-stop-{uuid.uuid4().hex}", tasks.client)
        is_stopped = False

        def submit(item: tuple[int, tuple[Team, Case]]) -> Future:
            number, (team, _) = item
            return tasks.client.submit(_explored, team, options, stop.name, key=f"{stop.name}-{number}", pure=False)

        def tick() -> None:
            nonlocal is_stopped
            if not is_stopped and is_over():
                is_stopped = True
                stop.set()

        early: dict[int, tuple[tuple[Team, Case], Exploration]] = {}
        finished = following = states = 0
        for (number, item), ended in tasks.completed(enumerate(teams), submit, tick):
            early[number] = item, _result(item[0], ended)
            finished, states = finished + 1, states + early[number][1].states
            if show:
                show(finished, states)
            while following in early:
                yield early.pop(following)
                following += 1
        with suppress(OSError):
            stop.clear()  # the scheduler stores it until then


def _result(team: Team, future: Future) -> Exploration:
    try:
        return result_of(future)  # type: ignore[no-any-return]
    except RobochocError:
        raise
    except KilledWorker:
        hint = "use fewer --states, or workers with more memory"
        raise ClusterLostError(f"exploring {team.name} has killed several workers of the cluster: {hint}") from None
    except Exception as error:
        raise ClusterLostError(f"{team.name}: a worker has failed: {type(error).__name__}: {error}") from error


def _explored(team: Team, options: CheckOptions, stop: str) -> Exploration:
    """Explore a team on a worker."""
    return explore(case_of(team, options.protocol, options.run), options, _StopCheck(stop))


class _StopCheck:
    """Asks from time to time whether this worker's task must stop. `name`: the name of the event."""

    def __init__(self, name: str) -> None:
        self._event, self._is_discarded = Event(name), discarded_check()
        self._next = time.monotonic()
        self._is_stopped = False

    def __call__(self, states: int) -> bool:  # noqa: ARG002 - as `explore` calls it
        """Return whether the task must stop."""
        if not self._is_stopped and time.monotonic() >= self._next:
            self._next = time.monotonic() + POLL_S
            self._is_stopped = self._is_discarded() or self._stop_requested()
        return self._is_stopped

    def _stop_requested(self) -> bool:
        try:
            return bool(self._event.is_set())
        except OSError:  # the scheduler is lost
            return True
