"""Sources of messages about the robots' situation. Packages offer sources in the entry points `robochoc.sources`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType, TracebackType
from typing import NamedTuple, Self

from robochoc.robots.sink import Fields
from robochoc.system.errors import RobochocError

REPORTS: Mapping[str, str] = MappingProxyType(
    {
        "battery": "sensor_msgs/BatteryState",
        "pose": "geometry_msgs/PoseStamped",
        "blocked": "geometry_msgs/PointStamped",
        "cleared": "geometry_msgs/PointStamped",
        "out_of_order": "std_msgs/String",
        "done": "std_msgs/String",
    }
)
"""The topics in a drone's namespace other than waypoints, by their last tokens, with their ROS types."""


class SourceError(RobochocError):
    """The source cannot be opened or read. The message has the reason, and a hint."""


class ReceivedMessage(NamedTuple):
    """A message: its topic, ROS type, fields (as in a sink), and time of reception."""

    topic: str
    kind: str
    fields: Fields
    at_ns: int


class Source(ABC):
    """Returns messages; a context manager. The caller that opens a source closes it.

    `place` is the text after the source's name on the command line: `run.mcap` in `mcap:run.mcap`. Raises
    `SourceError`.
    """

    live: bool = True
    """True if messages arrive in real time. False for a recording, in which all messages are available at once."""

    def __init__(self, place: str) -> None:
        self.place = place
        self.others: dict[str, str] = {}
        """The first few other topics in a recording, with their types."""

    @property
    def is_busy(self) -> bool:
        """True if robots are still flying: the wait for their reports begins after their arrival."""
        return False

    def assign(self, namespaces: Mapping[str, str]) -> None:  # noqa: B027 - only sources that know robots by name need them
        """Set the namespaces of drones' reports, by drone name. Raises `SourceError`."""

    @abstractmethod
    def listen(self, topics: Mapping[str, str]) -> None:
        """Subscribe to `topics` (name to type, both with ROS names). Raises `SourceError`.

        Messages with another type on these topics are ignored.
        """

    def check(self) -> None:  # noqa: B027 - most sources need no sink
        """Raise `SourceError` if the source lacks a sink. It is called when all sinks are open."""

    @abstractmethod
    def next(self, wait_s: float) -> ReceivedMessage | None:
        """Return the next message; None at the end of a recording, or if none arrives within `wait_s`.

        Raises `SourceError`.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the source."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
