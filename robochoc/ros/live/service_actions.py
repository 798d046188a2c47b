"""Goals of ROS 2 actions, sent by calls of the action's services over DDS or zenoh."""

from __future__ import annotations

import time
from collections.abc import Mapping

from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import Source, SourceError
from robochoc.ros.interfaces import CANCEL_GOAL
from robochoc.ros.live.actions import FINAL_STATUSES, SLICE_S, Actions, GoalEvent, GoalPhase
from robochoc.ros.live.service_calls import Answer, ServiceCalls

RESULT_S = 86_400.0
"""The longest time for a goal, in seconds: until then, zenoh waits for the result."""
_SERVICES = ("send_goal", "cancel_goal", "get_result")


class ServiceActions(Actions):
    """Actions over a middleware of ROS 2. `calls` is closed together with this object."""

    def __init__(self, calls: ServiceCalls) -> None:
        super().__init__()
        self.where = calls.where
        self._calls = calls
        self._source: Source | None = None
        self._steps: dict[int, tuple[str, str]] = {}
        """The goal and the service of each call without an answer."""

    def prepare(self, actions: Mapping[str, str]) -> None:
        """Prepare goals for `actions`."""
        services: dict[str, str] = {}
        for action, kind in actions.items():
            services |= {
                f"{action}/_action/send_goal": f"{kind}_SendGoal",
                f"{action}/_action/cancel_goal": CANCEL_GOAL,
                f"{action}/_action/get_result": f"{kind}_GetResult",
            }
        self._calls.prepare(services)
        try:
            self._source = self._calls.source()
            self._source.listen(
                {f"{name}/_action/feedback": f"{kind}_FeedbackMessage" for name, kind in actions.items()}
            )
        except SourceError as error:
            raise SinkError(str(error)) from error

    def has_server(self, action: str) -> bool | None:
        """Return whether a server accepts goals and cancellations, and returns results."""
        found = [self._calls.has_server(f"{action}/_action/{one}") for one in _SERVICES]
        return None if None in found else all(found)

    def next(self, wait_s: float) -> GoalEvent | None:
        """Return the next event. Answers come before feedback."""
        until = time.monotonic() + wait_s
        slice_s = 0.0
        while True:
            answer = self._calls.answer(slice_s)
            event = self._feedback() if answer is None else self._answered(answer)
            left_s = until - time.monotonic()
            if event is not None or (answer is None and left_s <= 0):
                return event
            slice_s = max(min(left_s, SLICE_S), 0.0) if answer is None else 0.0

    def close(self) -> None:
        """End the connection."""
        if self._source is not None:
            self._source.close()
        self._calls.close()

    def _send(self, goal: str, action: str, fields: Fields, wait_s: float) -> None:
        self._call(goal, action, "send_goal", {"goal_id": _uuid(goal), "goal": fields}, wait_s)

    def _cancel(self, goal: str, action: str) -> None:
        self._call(goal, action, "cancel_goal", {"goal_info": {"goal_id": _uuid(goal)}}, RESULT_S)

    def _call(self, goal: str, action: str, service: str, fields: Fields, wait_s: float) -> None:
        number = self._calls.call(f"{action}/_action/{service}", fields, wait_s)
        self._steps[number] = goal, service

    def _answered(self, answer: Answer) -> GoalEvent | None:
        """Return the event in an answer; request the result of an accepted goal."""
        goal, service = self._steps.pop(answer.number, ("", ""))
        fields = answer.fields
        if service == "cancel_goal":  # the result shows whether the goal was cancelled
            return None
        if fields is None:
            return self._event(goal, GoalPhase.LOST, {}, answer.why)
        if service == "send_goal":
            if not fields["accepted"]:
                return self._event(goal, GoalPhase.REJECTED, {})
            event = self._event(goal, GoalPhase.ACCEPTED, {})
            if goal in self._open:
                self._call(goal, self._open[goal].action, "get_result", {"goal_id": _uuid(goal)}, RESULT_S)
            return event
        phase = FINAL_STATUSES.get(fields["status"], GoalPhase.LOST)
        why = "" if phase is not GoalPhase.LOST else f"the result has the status {fields['status']}"
        return self._event(goal, phase, fields["result"], why)

    def _feedback(self) -> GoalEvent | None:
        """Return the oldest feedback of an open goal; None if there is none."""
        while self._source is not None:
            try:
                received = self._source.next(0)
            except SourceError as error:
                raise SinkError(str(error)) from error
            if received is None:
                return None
            goal = bytes(received.fields["goal_id"]["uuid"]).hex()
            event = self._event(goal, GoalPhase.FEEDBACK, received.fields["feedback"])
            if event is not None:
                return event
        return None


def _uuid(goal: str) -> Fields:
    return {"uuid": [*bytes.fromhex(goal)]}
