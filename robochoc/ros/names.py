"""Names for ROS. A team's files call a topic `/drone3.1/waypoint3.1`; neither ROS 1 nor ROS 2 allows that name.

A name here is `/` and tokens of letters, digits and single underscores, each beginning with a letter: legal in ROS 1
(wiki.ros.org/Names) and in ROS 2 (design.ros2.org, "Topic and Service name mapping to DDS"). Legal names stay as they
are.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
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
"""Topics of the whole team, which mean the same in every ROS, and their types."""

NAME_MAX = 240
"""Characters of a name: ROS 2 passes on a few more to DDS."""

_LEGAL = re.compile(r"[A-Za-z](?:_?[A-Za-z0-9])*_?")
_RESERVED = {*TEAM_TOPICS, "/clock", "/rosout", "/rosout_agg", "/parameter_events", "/bond"}
"""Topics with a meaning of their own in every ROS."""


class NameClashError(RobochocError):
    """Two topics would have one name in ROS, or a name is too long for it. The message says what to do."""


class TopicNames:
    """The names in ROS of what `drones` publish, by the drones' numbers. Raises `NameClashError`."""

    original: Mapping[str, str]
    """From a waypoint's topic in ROS to its name in the robot's file. For a drone without a topic, from its namespace
    to the drone's name.
    """

    def __init__(self, drones: Sequence[Drone]) -> None:
        self._waypoints = [None if drone.topic is None else ros_name(drone.topic.name) for drone in drones]
        self._namespaces = [*_namespaces(drones, self._waypoints)]
        owners: dict[str, int] = {}
        for number, topic in self._topics():
            if len(topic) > NAME_MAX:
                what = _described(drones[number])
                raise NameClashError(on_one_line(f"{what}: the name is too long for ROS: shorten it"))
            other = owners.setdefault(topic, number)
            if other != number:
                raise NameClashError(_clash(topic, drones[other], drones[number]))
        table = zip(self._waypoints, self._namespaces, drones, strict=True)
        self.original = MappingProxyType(
            {topic or space: drone.name if drone.topic is None else drone.topic.name for topic, space, drone in table}
        )

    def waypoint(self, number: int) -> str | None:
        """Return the topic of a drone's waypoints; None if its robot's file names none."""
        return self._waypoints[number]

    def namespace(self, number: int) -> str:
        """Return the namespace of a drone's reports: `/drone3_1`, so that its battery is `/drone3_1/battery`."""
        return self._namespaces[number]

    def reports(self) -> dict[str, str]:
        """Return the topics of all that drones may report, and their types."""
        return {f"{space}/{token}": kind for space in self._namespaces for token, kind in REPORTS.items()}

    def _topics(self) -> Iterator[tuple[int, str]]:
        for number, topic in enumerate(self._waypoints):
            if topic is not None:
                yield number, topic
        for number in range(len(self._namespaces)):
            for token in REPORTS:
                yield number, f"{self._namespaces[number]}/{token}"


def is_for_waypoints(topic: str, kind: str) -> bool:
    """Return whether `topic`, of the ROS type `kind`, is for waypoints: no report, and no topic of the team's."""
    return topic not in TEAM_TOPICS and REPORTS.get(topic.rpartition("/")[2]) != kind.replace("/msg/", "/")


def ros_name(name: str) -> str:
    """Return `name` as ROS allows it: `/drone3_1/waypoint3_1`. Different names may become the same."""
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
    """Return letters and digits without accents; letters of other alphabets by their code, the rest as underscores."""
    if char.isascii():
        return char if char.isalnum() else "_"
    if unicodedata.combining(char):
        return ""
    return f"u{ord(char):x}" if char.isalnum() else "_"


def _namespaces(drones: Sequence[Drone], waypoints: Sequence[str | None]) -> Iterator[str]:
    """Yield the first token of the waypoints' topic where no other drone's topic has it, else all of that topic."""
    names = [ros_name(drone.name.replace("/", "_")) for drone in drones]
    first = ["/" + topic.split("/")[1] if topic else name for topic, name in zip(waypoints, names, strict=True)]
    shared = Counter(first)
    for topic, own in zip(waypoints, first, strict=True):
        reports = topic is not None and topic in {f"{own}/{token}" for token in REPORTS}
        yield topic if topic and (shared[own] > 1 or reports) else own


def _clash(topic: str, first: Drone, second: Drone) -> str:
    if first.topic and second.topic and first.topic.name == second.topic.name:
        who = [f"{drone.name} ({drone.robot})" if drone.robot else drone.name for drone in (first, second)]
        clash = f"{who[0]} and {who[1]} both publish on {second.topic.name!r}: give each a topic of its own"
    else:
        clash = f"{_described(first)} and {_described(second)} would both publish on {topic} in ROS: rename one of them"
    return on_one_line(clash)


def _described(drone: Drone) -> str:
    what = f"drone {drone.name!r}" if drone.topic is None else f"topic {drone.topic.name!r}"
    return f"{what} of {drone.robot}" if drone.robot else what
