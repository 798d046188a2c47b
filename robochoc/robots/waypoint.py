"""A waypoint: the goal of one drone after a decision."""

from __future__ import annotations

from dataclasses import dataclass

from robochoc.flight.layout import Point


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
