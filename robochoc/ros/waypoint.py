"""Waypoints: what a decision asks of one drone, to be published."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from robochoc.flight.layout import Point
from robochoc.flight.mission import Drone, Leg
from robochoc.ros.names import TopicNames


@dataclass(frozen=True)
class Waypoint:
    """The goal of a drone: the paper's `/drone3.1/waypoint3.1` (Section 4.2)."""

    drone: int
    """The drone's number in the mission."""
    topic: str
    """The topic, by its name in ROS."""
    kind: str
    """The ROS type that the robot's file asks for."""
    at: Point
    """In metres, in `frame`."""
    lands: bool
    """True if the drone is to land there, because its robot has withdrawn."""
    frame: str
    stamp: int
    """The time of the decision, in nanoseconds."""
    before: Point | None = None
    """The goal before this one; None if the drone had none."""


def waypoints(
    leg: Leg,
    drones: Sequence[Drone],
    names: TopicNames,
    frame: str,
    stamp: int,
    before: Mapping[int, Point] = MappingProxyType({}),
) -> tuple[Waypoint, ...]:
    """Return the waypoints of `leg`, of drones that fly and of those that land. Drones without a topic have none.

    `before` are the goals of the decision before, by the drones' numbers.
    """
    found = []
    for number, goal in sorted(leg.goals.items()):
        topic, name = drones[number].topic, names.waypoint(number)
        if topic is not None and name is not None:
            found.append(Waypoint(number, name, topic.type, goal.at, goal.lands, frame, stamp, before.get(number)))
    return tuple(found)
