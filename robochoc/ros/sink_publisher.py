"""Publishes a run into one sink, and counts what was published."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Drone, Leg, Mission
from robochoc.flight.reports import OutOfOrder, Report
from robochoc.ros.publisher import Publisher
from robochoc.ros.sink import Sink
from robochoc.ros.team_topics import WAYPOINTS_ALONE, PublishOptions
from robochoc.ros.waypoint import waypoints

SECOND_NS = 1_000_000_000
POSES_HZ = 20


class SinkPublisher:
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


class FlightBroadcast:
    """Publishes a flight as its time goes by: reports, and all poses `POSES_HZ` times a second."""

    def __init__(self) -> None:
        self._ticks = 0

    def publish(
        self, publishers: Sequence[SinkPublisher], flown: FlightLog, reports: Sequence[Report], until_s: float
    ) -> None:
        """Publish what of `flown` was not published yet, up to `until_s`, and `reports` among it.

        Raises `SinkError`.
        """
        untold = deque(reports)
        while (at_s := self._ticks / POSES_HZ) <= until_s:
            while untold and untold[0].at_s <= at_s:
                _report(publishers, untold.popleft())
            after = min(int(np.searchsorted(flown.times, at_s)), len(flown.times) - 1)
            for publisher in publishers:
                publisher.poses(flown.positions[after], flown.attitudes[after], at_s)
            self._ticks += 1
        for report in untold:
            _report(publishers, report)


def publish_flight(mission: Mission, flown: FlightLog, publishers: Sequence[SinkPublisher]) -> None:
    """Publish a whole flight: each leg's waypoints as it begins, poses, and drones that fall. Raises `SinkError`."""
    if not publishers:
        return
    fallen = {number for number, error in enumerate(flown.errors_m) if np.isnan(error)}
    falls = {one.drone: one for one in reversed(flown.events) if one.drone in fallen}
    reports = sorted((OutOfOrder(flown.names[n], one.what, one.at_s) for n, one in falls.items()), key=lambda r: r.at_s)
    broadcast = FlightBroadcast()
    begins_s = [0.0, *(times.begins_s for times in flown.legs[1:]), flown.simulated_s]
    for leg, (begin_s, end_s) in zip(mission.legs, pairwise(begins_s), strict=True):
        for publisher in publishers:
            publisher.decide(leg, nanoseconds(begin_s))
        broadcast.publish(publishers, flown, [one for one in reports if begin_s < one.at_s <= end_s], end_s)


def _report(publishers: Sequence[SinkPublisher], report: Report) -> None:
    for publisher in publishers:
        publisher.report(report)


def nanoseconds(at_s: float) -> int:
    """Return a time in seconds as nanoseconds."""
    return round(at_s * SECOND_NS)
