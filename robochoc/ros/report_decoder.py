"""From raw messages to reports: what robots publish of their situation, in either ROS.

A drone reports in its own namespace (`names.py`). Messages come from outside: whatever is not as it should be, a number
that is none, a place in another frame, is passed over.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from robochoc.flight.layout import Point
from robochoc.flight.mission import Drone
from robochoc.flight.reports import Battery, Blocked, Cleared, OutOfOrder, Pose, Report
from robochoc.formats.diagnostics import on_one_line
from robochoc.ros.names import REPORTS, TopicNames
from robochoc.ros.source import ReceivedMessage

LONGEST = 200
"""Characters of a reason that are kept."""
_FAR_M = 1e9
"""Nothing is further away than that: coordinates beyond it are no places."""


class ReportDecoder:
    """Reads what `drones` report. Raises `NameClashError` where their topics cannot be told apart.

    Places count in `frame`; a message that names no frame is taken to mean it.
    """

    topics: Mapping[str, str]
    """What there is to listen to: topics and types, both by their ROS names."""
    strange: dict[str, str]
    """Topics on which places came in another frame, and the last one of these."""

    def __init__(self, drones: Sequence[Drone], frame: str) -> None:
        names = TopicNames(drones)
        self._frame = frame.removeprefix("/")
        self._told = {
            f"{names.namespace(number)}/{token}": (drone.name, token)
            for number, drone in enumerate(drones)
            for token in REPORTS
        }
        self.topics = {topic: REPORTS[token] for topic, (_, token) in self._told.items()}
        self.strange = {}

    def report(self, heard: ReceivedMessage) -> Report | None:
        """What the message reports, at the time at which it was received; None where it says nothing."""
        drone, token = self._told.get(heard.topic, ("", ""))
        at_s = heard.at_ns / 1e9
        match token:
            case "battery":
                level = _number(heard.fields, "percentage")
                return None if level is None else Battery(drone, level, at_s)
            case "out_of_order":
                why = heard.fields.get("data")
                return OutOfOrder(drone, on_one_line(why[:LONGEST]) if isinstance(why, str) else "", at_s)
            case "pose":
                place = self._place(heard, "pose", "position")
                return None if place is None else Pose(drone, place, at_s)
            case "blocked" | "cleared":
                place = self._place(heard, "point")
                kind = Cleared if heard.topic.endswith("/cleared") else Blocked
                return None if place is None else kind(drone, place, at_s)
            case _:
                return None

    def _place(self, heard: ReceivedMessage, *path: str) -> Point | None:
        """The point that stands at `path` in the message, if it is one of our frame."""
        frame = _at(heard.fields, ("header",)).get("frame_id")
        if isinstance(frame, str) and frame.removeprefix("/") not in {"", self._frame}:
            self.strange[heard.topic] = on_one_line(frame[:LONGEST])
            return None
        fields = _at(heard.fields, path)
        x, y, z = (_number(fields, axis) for axis in "xyz")
        return None if x is None or y is None or z is None else (x, y, z)


def _at(fields: object, path: Sequence[str]) -> Mapping[str, object]:
    """The fields at `path`; none where there is nothing of that kind."""
    for name in path:
        fields = fields.get(name) if isinstance(fields, Mapping) else None
    return fields if isinstance(fields, Mapping) else {}


def _number(fields: Mapping[str, object], name: str) -> float | None:
    """A number that can be reckoned with."""
    value = fields.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) <= _FAR_M and math.isfinite(value) else None
