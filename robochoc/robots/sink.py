"""Sinks publish the messages of a mission. Packages offer sinks in the entry point group `robochoc.sinks`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, Self

from robochoc.flight.layout import Point
from robochoc.flight.mission import Drone, GoalStop
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True)
class Waypoint:
    """The goal of a drone, such as `/drone3.1/waypoint3.1` in the paper (Section 4.2)."""

    drone: int
    """The drone's number in the mission."""
    topic: str
    """The ROS name of the topic."""
    kind: str
    """The ROS type given in the robot's file."""
    at: Point
    """The place in metres, in `frame`."""
    lands: bool
    """True if the drone should land there, because its robot has withdrawn."""
    frame: str
    stamp: int
    """The time of the decision, in nanoseconds."""
    before: Point | None = None
    """The previous goal; None if the drone had none."""
    stops: tuple[GoalStop, ...] = ()
    """All places of a robot that does tasks one after the other; the first one is `at`."""

    @property
    def way(self) -> list[Point]:
        """The places in order: those of all stops, or `at`."""
        return [stop.at for stop in self.stops] or [self.at]


Fields = Mapping[str, Any]
"""The nested fields of a message, by their ROS names. Times (`stamp`) are integers, in nanoseconds. A missing field is
zero or empty.
"""


class SinkError(RobochocError):
    """The sink cannot be opened or written to. The message has the reason, and a hint."""


class Sink(ABC):
    """Receives messages; a context manager. The caller that opens a sink closes it.

    `place` is the text after the sink's name on the command line: `run.mcap` in `mcap:run.mcap`. Raises `SinkError`.
    """

    live: bool = True
    """True if robots may receive the messages. False for a recording."""

    wants_reports: bool = True
    """True if the sink also receives the robots' reports and poses."""

    arms: bool = False
    """True if the sink commands robots, which it may arm only after `allow_arming`."""
    summary: str = ""
    """A summary of the results of decisions, available after `close`; empty if the sink only publishes."""

    def __init__(self, place: str) -> None:
        self.place = place

    def allow_arming(self) -> None:  # noqa: B027 - most send no commands
        """Allow arming. Before this call, a sink that `arms` sends no commands. Raises `SinkError`."""

    def assign(self, drones: Sequence[Drone]) -> None:  # noqa: B027 - only sinks that command robots need them
        """Set the drones to which the numbers in waypoints refer. Raises `SinkError`."""

    def decide(self, waypoints: Sequence[Waypoint]) -> None:  # noqa: B027 - most publish each waypoint separately
        """Receive all waypoints in a decision, before they are published one by one. Raises `SinkError`."""

    def explain(self, original: Mapping[str, str]) -> None:  # noqa: B027 - only recordings store them
        """Set the original names of topics, from the team's files, by ROS name. Raises `SinkError`."""

    def advertise(self, topics: Mapping[str, str]) -> None:  # noqa: B027 - nothing to do for files
        """Announce topics and the types of their messages, both with ROS names. Raises `SinkError`."""

    @abstractmethod
    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Publish a message of the ROS type `kind` on `topic`; `at_ns` is since the epoch. Raises `SinkError`."""

    @abstractmethod
    def close(self) -> None:
        """Finish after the last message. A file appears only now. Raises `SinkError`."""

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
