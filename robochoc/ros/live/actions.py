"""Clients of ROS actions over DDS, zenoh or a rosbridge: goals are sent, and their events arrive later.

A ROS 2 action consists of three services, `send_goal`, `cancel_goal` and `get_result`, and two topics, of which this
client reads `feedback` (design.ros2.org, "Actions"). Servers are untrusted: events of unknown or ended goals, repeated
events, and messages that cannot be read are ignored. A goal may also stay without events, so callers need a time limit.
"""

from __future__ import annotations

import secrets
from abc import ABC, abstractmethod
from collections.abc import Mapping
from enum import Enum, auto
from types import MappingProxyType
from typing import NamedTuple, Self

from robochoc.robots.sink import Fields
from robochoc.system.lazy_dataclass import dataclass

SLICE_S = 0.05
"""The longest time until an event is noticed, in seconds."""
_UUID_BYTES = 16


class GoalPhase(Enum):
    """The progress of a goal. All phases except `ACCEPTED` and `FEEDBACK` end it."""

    ACCEPTED = auto()
    REJECTED = auto()
    FEEDBACK = auto()
    SUCCEEDED = auto()
    CANCELED = auto()
    ABORTED = auto()
    LOST = auto()
    """The server has sent an unreadable answer, or its middleware reports that it is gone."""


FINAL_STATUSES: Mapping[object, GoalPhase] = MappingProxyType(
    {4: GoalPhase.SUCCEEDED, 5: GoalPhase.CANCELED, 6: GoalPhase.ABORTED}
)
"""The phases of the final values of `action_msgs/GoalStatus`."""


class GoalEvent(NamedTuple):
    """An event of the goal with this id: `fields` are those of the feedback or the result."""

    goal: str
    phase: GoalPhase
    fields: Fields
    why: str = ""
    """The error of the middleware, if there is one."""


@dataclass
class _Goal:
    action: str
    is_accepted: bool = False


class Actions(ABC):
    """Sends goals to action servers; a context manager. All methods raise `SinkError`."""

    where: str = ""
    """A description of the place of the servers."""

    def __init__(self) -> None:
        self._open: dict[str, _Goal] = {}

    @abstractmethod
    def prepare(self, actions: Mapping[str, str]) -> None:
        """Prepare goals for `actions` (name to type, such as `nav2_msgs/NavigateToPose`). May be called once."""

    @abstractmethod
    def has_server(self, action: str) -> bool | None:
        """Return whether a server offers `action`; None if the middleware cannot tell."""

    def send(self, action: str, goal: Fields, wait_s: float) -> str:
        """Send a goal, which must be accepted within `wait_s` seconds; return its id."""
        name = secrets.token_hex(_UUID_BYTES)
        self._open[name] = _Goal(action)
        self._send(name, action, goal, wait_s)
        return name

    def cancel(self, goal: str) -> None:
        """Request the end of a goal. Its event `CANCELED` may follow, or another one."""
        if goal in self._open:
            self._cancel(goal, self._open[goal].action)

    def forget(self, goal: str) -> None:
        """Ignore all further events of a goal."""
        self._open.pop(goal, None)

    @abstractmethod
    def next(self, wait_s: float) -> GoalEvent | None:
        """Return the next event, or the first to arrive within `wait_s` seconds; None if none arrives."""

    @abstractmethod
    def close(self) -> None:
        """End the connection. Goals continue."""

    @abstractmethod
    def _send(self, goal: str, action: str, fields: Fields, wait_s: float) -> None:
        """Send a goal."""

    @abstractmethod
    def _cancel(self, goal: str, action: str) -> None:
        """Send a request to cancel a goal."""

    def _event(self, goal: str, phase: GoalPhase, fields: Fields, why: str = "") -> GoalEvent | None:
        """Return the event; None if it repeats an event, or belongs to an unknown or ended goal."""
        found = self._open.get(goal)
        if found is None or (phase is GoalPhase.ACCEPTED and found.is_accepted):
            return None
        if phase in {GoalPhase.ACCEPTED, GoalPhase.FEEDBACK}:
            found.is_accepted = True
        else:
            del self._open[goal]
        return GoalEvent(goal, phase, fields, why)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_actions(text: str) -> Actions:
    """Return a client in the place `text`, such as `dds:5`. Raises `SinkError`."""
    kind, _, place = text.partition(":")
    if kind == "rosbridge":
        from robochoc.ros.live.rosbridge_actions import RosbridgeActions  # noqa: PLC0415 - start-up

        return RosbridgeActions(place)
    from robochoc.ros.live.service_actions import ServiceActions  # noqa: PLC0415 - start-up
    from robochoc.ros.live.service_calls import open_calls  # noqa: PLC0415 - start-up

    return ServiceActions(open_calls(text))
