"""An action offered through a rosbridge for ROS 2, by its own operations for actions."""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.robots.sink import Fields
from robochoc.ros.live.action_goals import ActionGoals, GoalClients, GoalStatus
from robochoc.ros.live.rosbridge_connection import Connection, MalformedMessageError, incoming, outgoing

_ID_MAX = 1_000
"""The maximum length of the id of a goal, in characters."""


class RosbridgeGoals(GoalClients):
    """The clients of the action `name` of the type `kind`, such as `robochoc_msgs/Decide`, through `connection`."""

    def __init__(self, name: str, kind: str, goals: ActionGoals, connection: Connection) -> None:
        self._name, self._goals, self._connection = name, goals, connection
        connection.intercept("send_action_goal", self._send_goal)
        connection.intercept("cancel_action_goal", self._cancel_goal)
        connection.send({"op": "advertise_action", "action": name, "type": kind.replace("/", "/action/", 1)})

    def status(self, goals: Mapping[str, tuple[GoalStatus, int]]) -> None:
        """Do nothing, since the bridge publishes the statuses."""

    def feedback(self, goal: str, fields: Fields) -> None:
        """Send feedback, unless the bridge is far behind."""
        if not self._connection.ended.is_set() and not self._connection.is_ahead():
            sent = {"op": "action_feedback", "action": self._name, "id": goal}
            self._connection.send({**sent, "values": outgoing(fields)})

    def ended(self, goal: str, status: GoalStatus, result: Fields) -> None:
        """Send the result."""
        sent = {"op": "action_result", "action": self._name, "id": goal, "status": int(status), "result": True}
        self._connection.send({**sent, "values": outgoing(result)})

    def stop(self) -> None:
        """Stop offering the action."""
        self._connection.send({"op": "unadvertise_action", "action": self._name})

    def _send_goal(self, message: Mapping[str, object]) -> bool:
        """Accept a goal, in the connection's thread. Goals without a valid id cannot be answered: ignore them."""
        goal = message.get("id")
        if message.get("action") != self._name or not isinstance(goal, str) or not 0 < len(goal) <= _ID_MAX:
            return True
        try:
            is_accepted = self._goals.accept(goal, incoming(message.get("args") or {})[0])
        except MalformedMessageError:
            is_accepted = False
        if not is_accepted:
            sent = {"op": "action_result", "action": self._name, "id": goal, "values": {}}
            self._connection.send({**sent, "status": int(GoalStatus.ABORTED), "result": False})
        return True

    def _cancel_goal(self, message: Mapping[str, object]) -> bool:
        goal = message.get("id")
        if message.get("action") == self._name and isinstance(goal, str):
            self._goals.cancel(goal)
        return True
