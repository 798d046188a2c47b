"""Publishers for a mission: the drones' decisions, poses and reports as ROS messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import assert_never

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from robochoc.flight.layout import Point
from robochoc.flight.mission import Drone, Leg
from robochoc.flight.reports import (
    BatteryReport,
    BlockedReport,
    ClearedReport,
    DoneReport,
    OutOfOrderReport,
    PoseReport,
    Report,
)
from robochoc.formats.diagnostics import on_one_line
from robochoc.model.expression import Constant
from robochoc.robots.mission_publisher import MissionPublisher, nanoseconds
from robochoc.robots.sink import Fields, Sink, Waypoint
from robochoc.robots.source import REPORTS
from robochoc.ros.names import TEAM_TOPICS, TopicNames
from robochoc.ros.team_topics import BODY, GOAL, WAYPOINTS_ONLY, PublishOptions, status, transform, transforms
from robochoc.ros.waypoint_types import NoMappingError, WaypointMapping, mapping_of, point
from robochoc.system.errors import RobochocError

_NOT_MEASURED = {
    name: float("nan")
    for name in ("voltage", "temperature", "current", "charge", "capacity", "design_capacity", "percentage")
}
"""NaN, as required by the definition of `sensor_msgs/BatteryState` for unmeasured values."""


class NothingToPublishError(RobochocError):
    """No drone of the team has a topic. The message suggests a solution."""


class Publisher:
    """Publishes the waypoints and reports of the `drones` in `team` to all `sinks`, without closing these.

    Times are in nanoseconds since the epoch, places in metres in `frame`. `options` select further messages. Methods
    raise `SinkError`, and `NoMappingError` if a package's mapping fails.

    Raises:
        NameClashError: Two topics would have the same name in ROS.
        NoMappingError: Waypoints cannot be converted to the type of a topic.
        NothingToPublishError: No drone has a topic.
        SinkError: A sink does not accept the topics.
    """

    def __init__(
        self,
        team: str,
        drones: Sequence[Drone],
        sinks: Sequence[Sink],
        frame: str = "map",
        options: PublishOptions = WAYPOINTS_ONLY,
    ) -> None:
        if all(drone.topic is None for drone in drones):
            problem = f"no drone of {team or 'the team'} has a topic to publish its waypoints on"
            raise NothingToPublishError(
                on_one_line(
                    f"{problem}: give its robot's file a <topic>, in Python by `topic` (documentation, page ROS)"
                )
            )
        self.names = TopicNames(drones)
        self._team = team
        self._drones = drones = [_with_kind(drone, options.kind) for drone in drones]
        self._options = options
        self._goals: dict[int, Point] = {}
        self._decisions = 0
        self._sinks = sinks
        self._frame = frame
        self._numbers = {drone.name: number for number, drone in reversed([*enumerate(drones)])}
        self._mappings: dict[str, WaypointMapping] = {}
        topics: dict[str, str] = {}
        for number, drone in enumerate(drones):
            topic = self.names.waypoint(number)
            if drone.topic is not None and topic is not None:
                kind = drone.topic.type
                self._mappings[kind] = mapping_of(drone.topic.name, drone.robot, kind)
                topics[topic] = kind
        for sink in sinks:
            sink.assign(drones)
            sink.explain(self.names.original)
            sink.advertise({**topics, **self.names.reports(), **options.topics})

    def decide(self, leg: Leg, at_ns: int) -> None:
        """Publish the waypoints of flying and landing drones in `leg`, then the messages selected by the options."""
        self._decisions += 1
        decided = waypoints(leg, self._drones, self.names, self._frame, at_ns, self._goals)
        for sink in self._sinks:
            sink.decide(decided)
        leg = without_ground_landings(leg, self._drones)
        for waypoint in (one for one in decided if one.drone in leg.goals):
            self._publish(waypoint.topic, waypoint.kind, self._fields(waypoint), at_ns)
        self._goals |= {number: goal.at for number, goal in leg.goals.items()}
        header = self._header(at_ns)
        if self._options.frames:
            # All current goals are sent, because a latched topic stores only its last message.
            frames = [transform(header, self._frame_of(number, GOAL), at) for number, at in sorted(self._goals.items())]
            self._team_publish("/tf_static", transforms(frames), at_ns)
        if self._options.diagnostics:
            self._team_publish("/diagnostics", status(self._team, leg, self._decisions, header), at_ns)

    def poses(self, positions: NDArray[np.float64], attitudes: NDArray[np.float64], at_ns: int) -> None:
        """Publish the poses of all drones: positions (N, 3) in metres, and quaternions x, y, z, w (N, 4)."""
        header = self._header(at_ns)
        flown = zip(positions.tolist(), attitudes.tolist(), strict=True)
        bodies = []
        for number, (at, (x, y, z, w)) in enumerate(flown):
            turned = {"x": x, "y": y, "z": z, "w": w}
            self._report(number, "pose", {"header": header, "pose": _pose(at, turned)}, at_ns)
            bodies.append(transform(header, self._frame_of(number, BODY), at, turned))
        if self._options.frames:
            self._team_publish("/tf", transforms(bodies), at_ns)

    def report(self, report: Report, at_ns: int) -> None:
        """Publish a drone's report. Raises `KeyError` if no drone has the name in the report."""
        number, header = self._numbers[report.drone], self._header(at_ns)
        match report:
            case BatteryReport():
                measured = {**_NOT_MEASURED, "percentage": report.level, "present": True}
                self._report(number, "battery", {"header": header, **measured}, at_ns)
            case PoseReport():
                self._report(number, "pose", {"header": header, "pose": _pose(report.place, {"w": 1.0})}, at_ns)
            case BlockedReport():
                self._report(number, "blocked", {"header": header, "point": point(report.place)}, at_ns)
            case ClearedReport():
                self._report(number, "cleared", {"header": header, "point": point(report.place)}, at_ns)
            case OutOfOrderReport():
                self._report(number, "out_of_order", {"data": report.why}, at_ns)
            case DoneReport():
                self._report(number, "done", {"data": report.task}, at_ns)
            case _:
                assert_never(report)

    def _fields(self, waypoint: Waypoint) -> Fields:
        try:
            return self._mappings[waypoint.kind].fields(waypoint)
        except Exception as error:
            problem = f"the installed mapping of waypoints to {waypoint.kind} failed: {type(error).__name__}: {error}"
            raise NoMappingError(on_one_line(problem)) from error

    def _header(self, at_ns: int) -> Fields:
        return {"stamp": at_ns, "frame_id": self._frame}

    def _report(self, number: int, token: str, fields: Fields, at_ns: int) -> None:
        self._publish(f"{self.names.namespace(number)}/{token}", REPORTS[token], fields, at_ns)

    def _frame_of(self, number: int, token: str) -> str:
        return f"{self.names.namespace(number)}/{token}"

    def _team_publish(self, topic: str, fields: Fields, at_ns: int) -> None:
        self._publish(topic, TEAM_TOPICS[topic], fields, at_ns)

    def _publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        for sink in self._sinks:
            sink.publish(topic, kind, fields, at_ns)


class SinkPublisher(MissionPublisher):
    """Publishes decisions, poses and reports of the `drones` in `team` to one `sink`, and counts these messages.

    Raises the same exceptions as `Publisher`.
    """

    def __init__(
        self, team: str, drones: Sequence[Drone], sink: Sink, frame: str, options: PublishOptions = WAYPOINTS_ONLY
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
        published = without_ground_landings(leg, self._drones)
        for waypoint in waypoints(published, self._drones, self._publisher.names, self._frame, at_ns):
            self._counts["landing" if waypoint.lands else "waypoint"] += 1
        self._publisher.decide(leg, at_ns)

    def report(self, report: Report) -> None:
        """Publish a drone's report with the time in the report. Raises `SinkError`."""
        if not self._sink.wants_reports:
            return
        self._counts["report"] += 1
        self._publisher.report(report, nanoseconds(report.at_s))

    def poses(self, positions: npt.NDArray[np.float64], attitudes: npt.NDArray[np.float64], at_s: float) -> None:
        """Publish the poses of all drones; see `Publisher.poses`. Raises `SinkError`."""
        if not self._sink.wants_reports:
            return
        self._counts["pose"] += len(positions)
        self._publisher.poses(positions, attitudes, nanoseconds(at_s))

    @property
    def summary(self) -> str:
        """Return the counts of published messages, such as `10 waypoints, 6 landings`, and the sink's summary."""
        first = ("waypoint", "landing")
        words = [
            f"{count:,} {name}{'s' * (count != 1)}" for name, count in self._counts.items() if count or name in first
        ]
        return "; ".join(filter(None, [", ".join(words), self._sink.summary]))


def waypoints(
    leg: Leg,
    drones: Sequence[Drone],
    names: TopicNames,
    frame: str,
    stamp: int,
    before: Mapping[int, Point] = MappingProxyType({}),
) -> tuple[Waypoint, ...]:
    """Return the waypoints of flying and landing drones in `leg`, except drones without a topic.

    `before` has the goals of the previous decision, by drone number.
    """
    found = []
    for number, goal in sorted(leg.goals.items()):
        topic, name = drones[number].topic, names.waypoint(number)
        if topic is not None and name is not None:
            before_at = before.get(number)
            found.append(Waypoint(number, name, topic.type, goal.at, goal.lands, frame, stamp, before_at, goal.stops))
    return tuple(found)


def without_ground_landings(leg: Leg, drones: Sequence[Drone]) -> Leg:
    """Return `leg` without the landing points of robots on the ground, which cannot land: the z of their topics is 0.

    A landing point is outside all places of the team, where a ground robot must not be sent.
    """
    on_ground = {number for number, drone in enumerate(drones) if drone.topic and drone.topic.z == Constant(0)}
    goals = {number: goal for number, goal in leg.goals.items() if not (goal.lands and number in on_ground)}
    return replace(leg, goals=goals)


def _with_kind(drone: Drone, kind: str) -> Drone:
    """Return `drone` with `kind` as the type of its topic; unchanged if `kind` is empty."""
    return replace(drone, topic=replace(drone.topic, type=kind)) if kind and drone.topic else drone


def _pose(at: Point, orientation: Fields) -> Fields:
    return {"position": point(at), "orientation": orientation}
