"""The goals of an action that this program offers: they wait, are decided one after the other, and can be cancelled.

Clients are untrusted. `ActionGoals` knows no middleware: the ends of its clients are `GoalClients`.
"""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from enum import IntEnum

from robochoc.robots.sink import Fields
from robochoc.ros.live.services import ENDED, WAITING_MAX, ServiceRequest
from robochoc.system.lazy_dataclass import dataclass

ENDED_MAX = 100
"""The number of ended goals whose results are stored for clients that ask later."""


class GoalStatus(IntEnum):
    """The values of `action_msgs/GoalStatus`."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class CancelCode(IntEnum):
    """The return codes of `action_msgs/CancelGoal`."""

    NONE = 0
    UNKNOWN_GOAL = 2
    ENDED_GOAL = 3


class GoalClients(ABC):
    """The clients of an action in one middleware. Methods are called in any thread."""

    @abstractmethod
    def status(self, goals: Mapping[str, tuple[GoalStatus, int]]) -> None:
        """Publish the statuses of all stored goals, and the times of their acceptance in nanoseconds."""

    @abstractmethod
    def feedback(self, goal: str, fields: Fields) -> None:
        """Publish feedback on a goal."""

    @abstractmethod
    def ended(self, goal: str, status: GoalStatus, result: Fields) -> None:
        """Send the result of a goal."""


@dataclass
class _Goal:
    status: GoalStatus
    accepted_ns: int
    result: Fields | None = None

    @property
    def is_ended(self) -> bool:
        return self.status >= GoalStatus.SUCCEEDED


class ActionGoals:
    """The goals of one action.

    Args:
        name: The name of the requests that goals become.
        cancel: Ends the current decision.
        refuse: Returns the result of a goal that is not decided, for a given reason.
    """

    clients: GoalClients | None = None
    """The clients of the action; None before it is offered."""

    def __init__(self, name: str, cancel: Callable[[], object], refuse: Callable[[str], Fields]) -> None:
        self.name = name
        self._early: list[ServiceRequest] = []
        """The goals that arrived before the queue was set."""
        self._put: Callable[[ServiceRequest], bool] | None = None
        self._cancel, self._refuse = cancel, refuse
        self._lock = threading.Lock()
        self._goals: dict[str, _Goal] = {}
        self._current = ""

    def set_queue(self, put: Callable[[ServiceRequest], bool]) -> None:
        """Set the queue of requests: `put` returns False if it is full."""
        with self._lock:
            early, self._early, self._put = self._early, [], put
        for request in early:
            put(request)

    def accept(self, goal: str, fields: Fields) -> bool:
        """Accept a new goal, or return False."""
        with self._lock:
            open_goals = sum(not one.is_ended for one in self._goals.values())
            if goal in self._goals or open_goals >= WAITING_MAX:
                return False
            self._goals[goal] = _Goal(GoalStatus.ACCEPTED, time.time_ns())
            request = ServiceRequest(self.name, fields, goal)
            if self._put is None:
                self._early.append(request)
            elif not self._put(request):
                del self._goals[goal]
                return False
        self._publish()
        return True

    def cancel(self, goal: str) -> CancelCode:
        """Cancel a goal. A waiting goal ends at once, and the current one soon."""
        with self._lock:
            found = self._goals.get(goal)
            if found is None:
                return CancelCode.UNKNOWN_GOAL
            if found.is_ended:
                return CancelCode.ENDED_GOAL
            is_waiting = found.status is GoalStatus.ACCEPTED
            found.status = GoalStatus.CANCELING
            if goal == self._current:  # while the lock is held, no other goal begins
                self._cancel()
        if is_waiting:
            self._end(goal, GoalStatus.CANCELED, self._refuse("cancelled before its decision began"))
        else:
            self._publish()
        return CancelCode.NONE

    def open_goals(self) -> list[str]:
        """Return the ids of the goals that have not ended."""
        with self._lock:
            return [name for name, goal in self._goals.items() if not goal.is_ended]

    def outcome(self, goal: str) -> tuple[GoalStatus, Fields | None]:
        """Return the status of a goal, and its result if it has ended."""
        with self._lock:
            found = self._goals.get(goal)
            return (GoalStatus.UNKNOWN, {}) if found is None else (found.status, found.result)

    def begin(self, goal: str) -> bool:
        """Begin the decision of a goal; return False if the goal was cancelled."""
        with self._lock:
            found = self._goals.get(goal)
            if found is None or found.status is not GoalStatus.ACCEPTED:
                return False
            found.status = GoalStatus.EXECUTING
            self._current = goal
        self._publish()
        return True

    def feedback(self, fields: Fields) -> None:
        """Send feedback on the current goal. A cancellation that came before the search is repeated."""
        with self._lock:
            goal = self._current
            is_canceling = goal in self._goals and self._goals[goal].status is GoalStatus.CANCELING
        if is_canceling:
            self._cancel()
        if goal and self.clients is not None:
            self.clients.feedback(goal, fields)

    def finish(self, answer: Fields) -> None:
        """End the current goal with its result."""
        with self._lock:
            goal, self._current = self._current, ""
            is_cancelled = goal in self._goals and self._goals[goal].status is GoalStatus.CANCELING
        failed = GoalStatus.CANCELED if is_cancelled else GoalStatus.ABORTED
        self._end(goal, GoalStatus.SUCCEEDED if answer.get("success") else failed, answer)

    def close(self) -> None:
        """End all goals, since the program ends."""
        for goal in self.open_goals():
            self._end(goal, GoalStatus.ABORTED, self._refuse(ENDED))

    def _end(self, goal: str, status: GoalStatus, result: Fields) -> None:
        with self._lock:
            found = self._goals.get(goal)
            if found is None or found.is_ended:  # another thread has ended it
                return
            found.status, found.result = status, result
            ended = [name for name, one in self._goals.items() if one.is_ended]
            for name in ended[:-ENDED_MAX]:
                del self._goals[name]
        if self.clients is not None:
            self.clients.ended(goal, status, result)
        self._publish()

    def _publish(self) -> None:
        with self._lock:
            statuses = {name: (goal.status, goal.accepted_ns) for name, goal in self._goals.items()}
        if self.clients is not None:
            self.clients.status(statuses)
