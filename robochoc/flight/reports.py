"""Robots' reports on their situation: the data for "read the robot situation" in the paper (Section 4.2).

Places are in metres, in the mission's frame. `at_s` is the time of the report, in seconds since a common beginning of
all reports of a source.
"""

from __future__ import annotations

from robochoc.flight.layout import Point
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True)
class BlockedReport:
    """There is an obstacle at `place`: no drone can be there."""

    drone: str
    place: Point
    at_s: float = 0.0


@dataclass(frozen=True)
class ClearedReport:
    """The obstacle at `place` is gone."""

    drone: str
    place: Point
    at_s: float = 0.0


@dataclass(frozen=True)
class OutOfOrderReport:
    """The drone can no longer fly."""

    drone: str
    why: str = ""
    at_s: float = 0.0


@dataclass(frozen=True)
class BatteryReport:
    """The charge of the drone's battery: 1 is full, 0 is empty."""

    drone: str
    level: float
    at_s: float = 0.0


@dataclass(frozen=True)
class PoseReport:
    """The position of a drone."""

    drone: str
    place: Point
    at_s: float = 0.0


@dataclass(frozen=True)
class DoneReport:
    """The robot has done the task of the variable `task`: the variable keeps its value."""

    drone: str
    task: str
    at_s: float = 0.0


Report = BlockedReport | ClearedReport | OutOfOrderReport | BatteryReport | PoseReport | DoneReport
