"""An outlet: one sink of a run, and how much was published there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from robochoc.ros.mission import Drone, Leg
from robochoc.ros.publisher import Publisher
from robochoc.ros.reports import Report
from robochoc.ros.sink import Sink
from robochoc.ros.waypoint import waypoints

SECOND_NS = 1_000_000_000


class Outlet:
    """Publishes what `drones` of `team` do into one `sink`, and counts. Raises what `Publisher` raises."""

    def __init__(self, team: str, drones: Sequence[Drone], sink: Sink, frame: str) -> None:
        self.live = sink.live
        self.place = sink.place
        self._frame = frame
        self._drones = drones
        self._publisher = Publisher(team, drones, [sink], frame)
        self._counts = dict.fromkeys(("waypoint", "landing", "report", "pose"), 0)

    def decide(self, leg: Leg, at_ns: int) -> None:
        """Publish where `leg` sends drones. Raises `SinkFailed`, `NoMapping`."""
        for waypoint in waypoints(leg, self._drones, self._publisher.names, self._frame, at_ns):
            self._counts["landing" if waypoint.lands else "waypoint"] += 1
        self._publisher.decide(leg, at_ns)

    def report(self, report: Report) -> None:
        """Publish what a drone reports, at the report's time. Raises `SinkFailed`."""
        self._counts["report"] += 1
        self._publisher.report(report, nanoseconds(report.at_s))

    def poses(self, positions: npt.NDArray[np.float64], attitudes: npt.NDArray[np.float64], at_s: float) -> None:
        """Publish where all drones are, see `Publisher.poses`. Raises `SinkFailed`."""
        self._counts["pose"] += len(positions)
        self._publisher.poses(positions, attitudes, nanoseconds(at_s))

    @property
    def told(self) -> str:
        """What was published, in a few words: `10 waypoints, 6 landings`."""
        first = ("waypoint", "landing")
        words = [
            f"{count:,} {name}{'s' * (count != 1)}" for name, count in self._counts.items() if count or name in first
        ]
        return ", ".join(words)


def nanoseconds(at_s: float) -> int:
    """A time in seconds as ROS has it."""
    return round(at_s * SECOND_NS)
