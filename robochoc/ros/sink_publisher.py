"""Publishes a run into one sink, and counts what was published."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from robochoc.flight.mission import Drone, Leg
from robochoc.flight.reports import Report
from robochoc.robots.mission_publisher import MissionPublisher, nanoseconds
from robochoc.robots.sink import Sink
from robochoc.ros.publisher import Publisher, waypoints
from robochoc.ros.team_topics import WAYPOINTS_ALONE, PublishOptions


class SinkPublisher(MissionPublisher):
    """Publishes decisions, poses and reports of `drones` of `team` into one `sink`. Raises what `Publisher` raises."""

    def __init__(
        self, team: str, drones: Sequence[Drone], sink: Sink, frame: str, options: PublishOptions = WAYPOINTS_ALONE
    ) -> None:
        self._sink = sink
        self.live = sink.live
        self.place = sink.place
        self._frame = frame
        self._drones = drones
        self._publisher = Publisher(team, drones, [sink], frame, options)
        self._counts = dict.fromkeys(("waypoint", "landing", "report", "pose"), 0)

    def decide(self, leg: Leg, at_ns: int) -> None:
        """Publish the waypoints of `leg`. Raises `SinkError`, `NoMappingError`."""
        for waypoint in waypoints(leg, self._drones, self._publisher.names, self._frame, at_ns):
            self._counts["landing" if waypoint.lands else "waypoint"] += 1
        self._publisher.decide(leg, at_ns)

    def report(self, report: Report) -> None:
        """Publish a drone's report, at the report's time. Raises `SinkError`."""
        self._counts["report"] += 1
        self._publisher.report(report, nanoseconds(report.at_s))

    def poses(self, positions: npt.NDArray[np.float64], attitudes: npt.NDArray[np.float64], at_s: float) -> None:
        """Publish all drones' poses, see `Publisher.poses`. Raises `SinkError`."""
        self._counts["pose"] += len(positions)
        self._publisher.poses(positions, attitudes, nanoseconds(at_s))

    @property
    def summary(self) -> str:
        """Return a short text on what was published, such as `10 waypoints, 6 landings`, and what came of it."""
        first = ("waypoint", "landing")
        words = [
            f"{count:,} {name}{'s' * (count != 1)}" for name, count in self._counts.items() if count or name in first
        ]
        return "; ".join(filter(None, [", ".join(words), self._sink.summary]))
