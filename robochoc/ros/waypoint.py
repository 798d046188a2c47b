"""Waypoints: what a decision asks of one drone, ready to be published."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robochoc.flight.layout import Point
from robochoc.flight.mission import Drone, Leg
from robochoc.ros.names import TopicNames


@dataclass(frozen=True)
class Waypoint:
    """Where a drone is to be: the paper's `/drone3.1/waypoint3.1` (Section 4.2)."""

    drone: int
    """Its number in the mission."""
    topic: str
    """By its name in ROS."""
    kind: str
    """The ROS type in which the robot's file wants it."""
    at: Point
    """In metres, in `frame`."""
    lands: bool
    """It is to be on the ground there: its robot takes part no more."""
    frame: str
    stamp: int
    """When it was decided, in nanoseconds."""


def waypoints(leg: Leg, drones: Sequence[Drone], names: TopicNames, frame: str, stamp: int) -> tuple[Waypoint, ...]:
    """What `leg` has `drones` publish, by their numbers: who flies, and who lands. Who stays publishes nothing.

    Nor does a drone whose robot's file names no topic.
    """
    found = []
    for number, goal in sorted(leg.goals.items()):
        topic, name = drones[number].topic, names.waypoint(number)
        if topic is not None and name is not None:
            found.append(Waypoint(number, name, topic.type, goal.at, goal.lands, frame, stamp))
    return tuple(found)
