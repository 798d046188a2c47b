"""An action offered over DDS or zenoh: three services and two topics, as in ROS 2 (design.ros2.org, "Actions")."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from robochoc.robots.sink import Fields
from robochoc.ros.interfaces import CANCEL_GOAL
from robochoc.ros.live.action_goals import ActionGoals, CancelCode, GoalClients, GoalStatus
from robochoc.ros.live.services import ServiceRequest, Services

ASKERS_MAX = 16
"""The maximum number of clients that wait for the result of one goal."""
OWED_S = 2.0
"""The longest wait at the end for clients that have not requested the result of their goal, in seconds."""
_SLICE_S = 0.02
_STATUS_KIND = "action_msgs/GoalStatusArray"


class ServiceGoals(GoalClients):
    """The clients of the action `name` of the type `kind`, such as `robochoc_msgs/Decide`.

    `services` and `handlers` are given to `Services`, and the resulting object to `attach`.
    """

    def __init__(self, name: str, kind: str, goals: ActionGoals) -> None:
        self._goals = goals
        self._topics = {f"{name}/_action/feedback": f"{kind}_FeedbackMessage", f"{name}/_action/status": _STATUS_KIND}
        self.services = {
            f"{name}/_action/send_goal": f"{kind}_SendGoal",
            f"{name}/_action/cancel_goal": CANCEL_GOAL,
            f"{name}/_action/get_result": f"{kind}_GetResult",
        }
        functions = (self._send_goal, self._cancel_goal, self._get_result)
        self.handlers = dict(zip(self.services, functions, strict=True))
        self._lock = threading.Lock()
        self._askers: dict[str, list[ServiceRequest]] = {}
        self._owed: set[str] = set()
        """The ended goals whose results no client has requested."""
        self._offered: Services | None = None

    def attach(self, offered: Services) -> None:
        """Announce the topics."""
        for topic, kind in self._topics.items():
            offered.announce(topic, kind)
        self._offered = offered

    def status(self, goals: Mapping[str, tuple[GoalStatus, int]]) -> None:
        """Publish the statuses. Results that are no longer stored cannot be requested."""
        with self._lock:
            self._owed &= goals.keys()
        listed = [{"goal_info": _info(goal, at_ns), "status": int(status)} for goal, (status, at_ns) in goals.items()]
        self._publish(1, {"status_list": listed})

    def feedback(self, goal: str, fields: Fields) -> None:
        """Publish feedback."""
        self._publish(0, {"goal_id": _uuid(goal), "feedback": fields})

    def ended(self, goal: str, status: GoalStatus, result: Fields) -> None:
        """Answer the clients that wait for the result."""
        with self._lock:
            askers = self._askers.pop(goal, [])
            if not askers:
                self._owed.add(goal)
        for request in askers:
            self._reply(request, _result(status, result))

    def wait_for_requests(self) -> None:
        """Wait until clients have requested all results, for at most `OWED_S` seconds."""
        until = time.monotonic() + OWED_S
        while self._owed and time.monotonic() < until:
            time.sleep(_SLICE_S)

    def _send_goal(self, request: ServiceRequest) -> Fields:
        goal = _goal_of(request.fields["goal_id"])
        return {"accepted": self._goals.accept(goal, request.fields["goal"]), "stamp": time.time_ns()}

    def _cancel_goal(self, request: ServiceRequest) -> Fields:
        """Cancel one goal, or with an empty id all goals."""
        goal = _goal_of(request.fields["goal_info"]["goal_id"])
        wanted = [goal] if goal.strip("0") else self._goals.open_goals()
        codes = {one: self._goals.cancel(one) for one in wanted}
        cancelled = [_info(one, 0) for one, code in codes.items() if code is CancelCode.NONE]
        code = CancelCode.NONE if cancelled or not wanted else codes[wanted[0]]
        return {"return_code": int(code), "goals_canceling": cancelled}

    def _get_result(self, request: ServiceRequest) -> Fields | None:
        """Return the result of an ended goal; None if the answer follows at its end."""
        goal = _goal_of(request.fields["goal_id"])
        with self._lock:
            status, result = self._goals.outcome(goal)
            if result is not None:
                self._owed.discard(goal)
                return _result(status, result)
            askers = self._askers.setdefault(goal, [])
            if len(askers) >= ASKERS_MAX:
                return _result(GoalStatus.UNKNOWN, {})
            askers.append(request)
            return None

    def _publish(self, number: int, fields: Fields) -> None:
        topic = [*self._topics][number]
        if self._offered is not None:
            with suppress(Exception):  # an error of a client must not end the decision
                self._offered.publish(topic, self._topics[topic], fields)

    def _reply(self, request: ServiceRequest, fields: Fields) -> None:
        if self._offered is not None:
            with suppress(Exception):  # as above
                self._offered.reply(request, fields)


def _result(status: GoalStatus, result: Fields) -> dict[str, Any]:
    return {"status": int(status), "result": result}


def _goal_of(uuid: Fields) -> str:
    return bytes(uuid["uuid"]).hex()


def _uuid(goal: str) -> Fields:
    return {"uuid": [*bytes.fromhex(goal)]}


def _info(goal: str, at_ns: int) -> Fields:
    return {"goal_id": _uuid(goal), "stamp": at_ns}
