"""Conversion to legal ROS names: topics in a team's file may have illegal names, such as `/drone3.1/waypoint3.1`.

Legal names consist of tokens that begin with a letter, contain letters, digits and single underscores, and are preceded
by `/`. This is legal in ROS 1 (wiki.ros.org/Names) and ROS 2 (design.ros2.org, "Topic and Service name mapping to
DDS"). Legal names are not changed.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

from robochoc.flight.mission import Drone
from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.source import REPORTS
from robochoc.system.errors import RobochocError

TEAM_TOPICS: Mapping[str, str] = MappingProxyType(
    {
        "/tf": "tf2_msgs/TFMessage",
        "/tf_static": "tf2_msgs/TFMessage",
        "/diagnostics": "diagnostic_msgs/DiagnosticArray",
    }
)
"""The topics for the whole team, with their standard ROS types."""

NAME_MAX = 240
"""The maximum length of a name, in characters. ROS 2 adds a few characters for DDS."""

_LEGAL = re.compile(r"[A-Za-z](?:_?[A-Za-z0-9])*_?")
_RESERVED = {*TEAM_TOPICS, "/clock", "/rosout", "/rosout_agg", "/parameter_events", "/bond"}
"""Topics with a fixed meaning in ROS."""


class NameClashError(RobochocError):
    """Two topics would have the same name in ROS, or a name is too long. The message suggests a solution."""


class TopicNames:
    """The ROS names of the drones' topics, by drone number. Raises `NameClashError`."""

    original: Mapping[str, str]
    """Maps the ROS name of a waypoint topic to the topic's name in the robot's file, and the namespace of a drone
    without a topic to the drone's name.
    """

    def __init__(self, drones: Sequence[Drone]) -> None:
        self._waypoints = [None if drone.topic is None else ros_name(drone.topic.name) for drone in drones]
        self._namespaces = [*_namespaces(drones, self._waypoints)]
        owners: dict[str, int] = {}
        for number, topic in self._topics():
            if len(topic) > NAME_MAX:
                subject = _description(drones[number])
                raise NameClashError(on_one_line(f"{subject}: the name is too long for ROS: shorten it"))
            other = owners.setdefault(topic, number)
            if other != number:
                raise NameClashError(_clash(topic, drones[other], drones[number]))
        table = zip(self._waypoints, self._namespaces, drones, strict=True)
        self.original = MappingProxyType(
            {topic or space: drone.name if drone.topic is None else drone.topic.name for topic, space, drone in table}
        )

    def waypoint(self, number: int) -> str | None:
        """Return the topic of a drone's waypoints; None if the file of its robot has no topic."""
        return self._waypoints[number]

    def namespace(self, number: int) -> str:
        """Return the namespace of a drone's reports: `/drone3_1`, so that its battery is `/drone3_1/battery`."""
        return self._namespaces[number]

    def reports(self) -> dict[str, str]:
        """Return the topics of all reports of the drones, and their types."""
        return {f"{space}/{token}": kind for space in self._namespaces for token, kind in REPORTS.items()}

    def _topics(self) -> Iterator[tuple[int, str]]:
        for number, topic in enumerate(self._waypoints):
            if topic is not None:
                yield number, topic
        for number in range(len(self._namespaces)):
            for token in REPORTS:
                yield number, f"{self._namespaces[number]}/{token}"


def is_for_waypoints(topic: str, kind: str) -> bool:
    """Return whether `topic`, with the ROS type `kind`, is for waypoints, not for reports or the whole team."""
    return topic not in TEAM_TOPICS and REPORTS.get(topic.rpartition("/")[2]) != kind.replace("/msg/", "/")


def ros_name(name: str) -> str:
    """Convert `name` to a legal name, such as `/drone3_1/waypoint3_1`. Different names may become the same."""
    tokens = [_token(token) for token in name.split("/") if token] or [_token("")]
    found = "/" + "/".join(tokens)
    return f"{found}_topic" if found in _RESERVED else found


def _token(text: str) -> str:
    if _LEGAL.fullmatch(text):
        return text
    plain = "".join(map(_plain, unicodedata.normalize("NFKD", text)))
    token = re.sub(r"_+", "_", plain).strip("_")
    return token if token[:1].isalpha() else f"n{token}"


def _plain(char: str) -> str:
    """Return a letter without its accent, the code of a letter from another alphabet, or `_` for other characters."""
    if char.isascii():
        return char if char.isalnum() else "_"
    if unicodedata.combining(char):
        return ""
    return f"u{ord(char):x}" if char.isalnum() else "_"


def _namespaces(drones: Sequence[Drone], waypoints: Sequence[str | None]) -> Iterator[str]:
    """Yield the drones' namespaces: the first token of the waypoint topic, or the whole topic.

    The whole topic is used if another robot has the same first token, if a topic of the same robot comes before, and if
    a waypoint topic with the token is called like a report.
    """
    names = [ros_name(drone.name.replace("/", "_")) for drone in drones]
    first = ["/" + topic.split("/")[1] if topic else name for topic, name in zip(waypoints, names, strict=True)]
    owners: dict[str, set[str]] = {}
    for number, (drone, own) in enumerate(zip(drones, first, strict=True)):
        owners.setdefault(own, set()).add(drone.robot or f"/{number}")
    reserved = {
        own for topic, own in zip(waypoints, first, strict=True) if topic in {f"{own}/{one}" for one in REPORTS}
    }
    given: set[str] = set()
    for topic, own in zip(waypoints, first, strict=True):
        yield topic if topic and (len(owners[own]) > 1 or own in given or own in reserved) else own
        given.add(own)


def _clash(topic: str, first: Drone, second: Drone) -> str:
    if first.topic and second.topic and first.topic.name == second.topic.name:
        names = [f"{drone.name} ({drone.robot})" if drone.robot else drone.name for drone in (first, second)]
        clash = f"{names[0]} and {names[1]} both publish on {second.topic.name!r}: give each its own topic"
    else:
        clash = f"{_description(first)} and {_description(second)} would both have the topic {topic} in ROS: rename one"
    return on_one_line(clash)


def _description(drone: Drone) -> str:
    subject = f"drone {drone.name!r}" if drone.topic is None else f"topic {drone.topic.name!r}"
    return f"{subject} of {drone.robot}" if drone.robot else subject
