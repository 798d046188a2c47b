"""Publishers for a mission: the drones' decisions, reports and poses, also from a simulated flight."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Leg, Mission
from robochoc.flight.reports import OutOfOrderReport, Report

SECOND_NS = 1_000_000_000
POSES_HZ = 20


class MissionPublisher(ABC):
    """Publishes the decisions, reports and poses of a team's drones. Methods raise `SinkError`."""

    live: bool
    """True if robots may receive the messages. False for a recording."""
    place: str
    """The place where messages are published, for reports."""

    @abstractmethod
    def decide(self, leg: Leg, at_ns: int) -> None:
        """Publish the waypoints of `leg`."""

    @abstractmethod
    def report(self, report: Report) -> None:
        """Publish a drone's report, with the time in the report."""

    @abstractmethod
    def poses(self, positions: npt.NDArray[np.float64], attitudes: npt.NDArray[np.float64], at_s: float) -> None:
        """Publish the poses of all drones: positions (N, 3) in metres, and quaternions x, y, z, w (N, 4)."""

    @property
    @abstractmethod
    def summary(self) -> str:
        """The counts of published messages as text, such as `10 waypoints, 6 landings`."""


class FlightBroadcast:
    """Publishes a flight step by step: reports, and the poses of all drones at `POSES_HZ`."""

    def __init__(self) -> None:
        self._ticks = 0

    def publish(
        self, publishers: Sequence[MissionPublisher], flown: FlightLog, reports: Sequence[Report], until_s: float
    ) -> None:
        """Publish the poses in `flown` since the last call, up to `until_s`, and `reports`, in chronological order.

        Raises `SinkError`.
        """
        pending = deque(reports)
        while (at_s := self._ticks / POSES_HZ) <= until_s:
            while pending and pending[0].at_s <= at_s:
                _report(publishers, pending.popleft())
            after = min(int(np.searchsorted(flown.times, at_s)), len(flown.times) - 1)
            for publisher in publishers:
                publisher.poses(flown.positions[after], flown.attitudes[after], at_s)
            self._ticks += 1
        for report in pending:
            _report(publishers, report)


def publish_flight(mission: Mission, flown: FlightLog, publishers: Sequence[MissionPublisher]) -> None:
    """Publish a whole flight: waypoints at the beginning of each leg, poses, and falling drones. Raises `SinkError`."""
    if not publishers:
        return
    fallen = {number for number, error in enumerate(flown.errors_m) if np.isnan(error)}
    falls = {one.drone: one for one in reversed(flown.events) if one.drone in fallen}
    reports = sorted(
        (OutOfOrderReport(flown.names[n], one.what, one.at_s) for n, one in falls.items()), key=lambda r: r.at_s
    )
    broadcast = FlightBroadcast()
    begins_s = [0.0, *(times.begins_s for times in flown.legs[1:]), flown.simulated_s]
    for leg, (begin_s, end_s) in zip(mission.legs, pairwise(begins_s), strict=True):
        for publisher in publishers:
            publisher.decide(leg, nanoseconds(begin_s))
        broadcast.publish(publishers, flown, [one for one in reports if begin_s < one.at_s <= end_s], end_s)


def _report(publishers: Sequence[MissionPublisher], report: Report) -> None:
    for publisher in publishers:
        publisher.report(report)


def nanoseconds(at_s: float) -> int:
    """Convert a time from seconds to nanoseconds."""
    return round(at_s * SECOND_NS)
