"""Goals of ROS 2 actions, sent through a rosbridge by its own operations for actions."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.robots.inbox import MessageInbox
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import ReceivedMessage
from robochoc.ros.live.actions import FINAL_STATUSES, SLICE_S, Actions, GoalEvent, GoalPhase
from robochoc.ros.live.rosbridge_connection import Connection, MalformedMessageError, incoming, outgoing


class RosbridgeActions(Actions):
    """Actions of ROS 2 through a rosbridge, which reports neither servers nor acceptance."""

    def __init__(self, place: str) -> None:
        super().__init__()
        self._connection = Connection(place, SinkError)
        self.where = f"rosbridge at {self._connection.url}"
        self._kinds: dict[str, str] = {}
        self._results: queue.SimpleQueue[Mapping[str, object]] = queue.SimpleQueue()
        self._ended: set[str] = set()
        """The open goals whose results have arrived."""
        self._inbox = MessageInbox()
        self._connection.intercept("action_feedback", self._receive_feedback)
        self._connection.intercept("action_result", self._receive_result)

    def prepare(self, actions: Mapping[str, str]) -> None:
        """Store the types of `actions`."""
        self._kinds = {name: kind.replace("/", "/action/", 1) for name, kind in actions.items()}

    def has_server(self, action: str) -> None:  # noqa: ARG002 - a rosbridge does not tell
        """Return None, since a rosbridge reports a missing server only as the result of a goal."""
        return

    def next(self, wait_s: float) -> GoalEvent | None:
        """Return the next event. Results come before feedback."""
        until = time.monotonic() + wait_s
        while True:
            event = next(self._events(), None)
            left_s = until - time.monotonic()
            if event is not None or left_s <= 0:
                return event
            self._connection.check()
            time.sleep(min(left_s, SLICE_S))

    def close(self) -> None:
        """Send all messages, and end the connection."""
        try:
            with suppress(SinkError):  # a lost server needs no message
                self._connection.drain()
        finally:
            self._connection.close()

    def _send(self, goal: str, action: str, fields: Fields, wait_s: float) -> None:  # noqa: ARG002 - see `Actions`
        sent = {"op": "send_action_goal", "id": goal, "action": action, "action_type": self._kinds[action]}
        self._connection.send({**sent, "args": outgoing(fields), "feedback": True})

    def _cancel(self, goal: str, action: str) -> None:
        self._connection.send({"op": "cancel_action_goal", "id": goal, "action": action})

    def _receive_feedback(self, message: Mapping[str, object]) -> bool:
        """Store feedback, in the connection's thread."""
        goal, action = message.get("id"), message.get("action")
        if isinstance(goal, str) and isinstance(action, str) and action in self._kinds:
            try:
                fields, weight = incoming(message.get("values"))
            except MalformedMessageError:
                return True
            self._inbox.put(ReceivedMessage(action, goal, fields, time.time_ns()), weight)
        return True

    def _receive_result(self, message: Mapping[str, object]) -> bool:
        """Store a result, in the connection's thread."""
        goal = message.get("id")
        if isinstance(goal, str) and goal in self._open and goal not in self._ended:
            self._ended.add(goal)
            self._results.put(message)
        return True

    def _events(self) -> Iterator[GoalEvent]:
        """Yield the events that have arrived."""
        while True:
            try:
                event = self._result(self._results.get_nowait())
            except queue.Empty:
                break
            if event is not None:
                yield event
        while (received := self._inbox.get(0)) is not None:
            event = self._event(received.kind, GoalPhase.FEEDBACK, received.fields)
            if event is not None:
                yield event

    def _result(self, message: Mapping[str, object]) -> GoalEvent | None:
        goal, status = str(message["id"]), message.get("status")
        values = message.get("values")
        if message.get("result") is False:
            return self._event(goal, GoalPhase.REJECTED, {}, shortened(on_one_line(str(values)[:200])))
        phase = FINAL_STATUSES.get(status, GoalPhase.LOST) if isinstance(status, int) else GoalPhase.LOST
        try:
            return self._event(goal, phase, incoming(values or {})[0])
        except MalformedMessageError as error:
            return self._event(goal, GoalPhase.LOST, {}, f"the result cannot be read: {error}")
