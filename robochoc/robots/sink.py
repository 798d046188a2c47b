"""Sinks: where a mission's messages go. Packages offer them under the entry point group `robochoc.sinks`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, Self

from robochoc.flight.mission import Drone
from robochoc.robots.waypoint import Waypoint

Fields = Mapping[str, Any]
"""A message's fields by their ROS names, nested. Times (`stamp`) are integers, in nanoseconds. A field without a value
is zero, or empty.
"""


class SinkError(Exception):
    """The sink cannot be opened or written to. The message says why, and what might help."""


class Sink(ABC):
    """Receives messages. It is a context manager: the caller that opens it closes it.

    `place` is what follows its name on the command line (`mcap:run.mcap`: `run.mcap`). Raises `SinkError`.
    """

    live: bool = True
    """True if robots may receive what is published. False for a recording, which only stores it."""

    arms: bool = False
    """True if it commands robots, which `allow_arming` lets it arm."""
    summary: str = ""
    """The results of the decisions, after `close`; empty if it only publishes."""

    def __init__(self, place: str) -> None:
        self.place = place

    def allow_arming(self) -> None:  # noqa: B027 - most send no commands
        """Allow arming; without it a sink that `arms` only observes. Raises `SinkError`."""

    def assign(self, drones: Sequence[Drone]) -> None:  # noqa: B027 - only sinks that command robots need them
        """Set the drones of the waypoints, by their numbers. Raises `SinkError`."""

    def decide(self, waypoints: Sequence[Waypoint]) -> None:  # noqa: B027 - most publish each waypoint separately
        """Receive all waypoints of a decision, before they are published one by one. Raises `SinkError`."""

    def explain(self, original: Mapping[str, str]) -> None:  # noqa: B027 - only recordings store them
        """Set the names of topics in the team's files, by their ROS names. Raises `SinkError`."""

    def advertise(self, topics: Mapping[str, str]) -> None:  # noqa: B027 - nothing to do for files
        """Announce topics and the types of their messages, both by their ROS names. Raises `SinkError`."""

    @abstractmethod
    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Publish a message of the ROS type `kind` on `topic`, at a time since the epoch. Raises `SinkError`."""

    @abstractmethod
    def close(self) -> None:
        """Finish: everything has been published. A file appears in its place only now. Raises `SinkError`."""

    def discard(self) -> None:
        """Finish after an error, without partial output."""
        self.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self.discard()
