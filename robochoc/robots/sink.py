"""Sinks, which publish a mission's messages. Packages offer them under the entry point group `robochoc.sinks`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

from robochoc.flight.layout import Point
from robochoc.flight.mission import Drone
from robochoc.system.errors import RobochocError


@dataclass(frozen=True)
class Waypoint:
    """The goal of a drone: the paper's `/drone3.1/waypoint3.1` (Section 4.2)."""

    drone: int
    """The drone's number in the mission."""
    topic: str
    """The topic, by its name in ROS."""
    kind: str
    """The ROS type given in the robot's file."""
    at: Point
    """The place in metres, in `frame`."""
    lands: bool
    """True if the drone is to land there, because its robot has withdrawn."""
    frame: str
    stamp: int
    """The time of the decision, in nanoseconds."""
    before: Point | None = None
    """The previous goal; None if the drone had none."""


Fields = Mapping[str, Any]
"""A message's fields by their ROS names, nested. Times (`stamp`) are integers, in nanoseconds. A field without a value
is zero, or empty.
"""


class SinkError(RobochocError):
    """The sink cannot be opened or written to. The message has the reason, and a hint."""


class Sink(ABC):
    """Receives messages. It is a context manager: the caller that opens it closes it.

    `place` is the text after its name on the command line (`mcap:run.mcap`: `run.mcap`). Raises `SinkError`.
    """

    live: bool = True
    """True if robots may receive the messages. False for a recording."""

    arms: bool = False
    """True if it commands robots, which it may arm only after `allow_arming`."""
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
        """Finish after the last message. A file appears in its place only now. Raises `SinkError`."""

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
