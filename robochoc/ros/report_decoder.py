"""From messages to reports: what robots publish of their situation, in ROS 1 or ROS 2.

A drone reports in its own namespace (`names.py`). Messages come from outside. What is not as it should be is ignored: a
value that is no number, a place in another frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from robochoc.flight.layout import Point
from robochoc.flight.mission import Drone
from robochoc.flight.reports import Battery, Blocked, Cleared, OutOfOrder, Pose, Report
from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.source import REPORTS, ReceivedMessage
from robochoc.ros.names import TopicNames

REASON_MAX = 200
"""Characters of a reason that are kept."""
_FAR_M = 1e9
"""Larger coordinates are no places."""


class ReportDecoder:
    """Decodes the reports of `drones`. Raises `NameClashError` where their topics would have the same name.

    Places count in `frame`. A message without a frame is taken to be in it.
    """

    topics: Mapping[str, str]
    """The topics of reports and their types, both by their ROS names."""
    namespaces: Mapping[str, str]
    """The namespace of each drone's topics, by the drone's name."""
    other_frames: dict[str, str]
    """Topics with places in another frame, and the last one of these frames."""

    def __init__(self, drones: Sequence[Drone], frame: str) -> None:
        names = TopicNames(drones)
        self._frame = frame.removeprefix("/")
        self._tokens = {
            f"{names.namespace(number)}/{token}": (drone.name, token)
            for number, drone in enumerate(drones)
            for token in REPORTS
        }
        self.namespaces = {drone.name: names.namespace(number) for number, drone in enumerate(drones)}
        self.topics = {topic: REPORTS[token] for topic, (_, token) in self._tokens.items()}
        self.other_frames = {}

    def report(self, received: ReceivedMessage) -> Report | None:
        """Return what the message reports, at the time at which it was received; None where it reports nothing."""
        drone, token = self._tokens.get(received.topic, ("", ""))
        at_s = received.at_ns / 1e9
        match token:
            case "battery":
                level = _number(received.fields, "percentage")
                return None if level is None else Battery(drone, level, at_s)
            case "out_of_order":
                why = received.fields.get("data")
                return OutOfOrder(drone, on_one_line(why[:REASON_MAX]) if isinstance(why, str) else "", at_s)
            case "pose":
                place = self._place(received, "pose", "position")
                return None if place is None else Pose(drone, place, at_s)
            case "blocked" | "cleared":
                place = self._place(received, "point")
                kind = Cleared if received.topic.endswith("/cleared") else Blocked
                return None if place is None else kind(drone, place, at_s)
            case _:
                return None

    def _place(self, received: ReceivedMessage, *path: str) -> Point | None:
        """Return the point at `path` in the message; None if it is not in our frame."""
        frame = _at(received.fields, ("header",)).get("frame_id")
        if isinstance(frame, str) and frame.removeprefix("/") not in {"", self._frame}:
            self.other_frames[received.topic] = on_one_line(frame[:REASON_MAX])
            return None
        fields = _at(received.fields, path)
        x, y, z = (_number(fields, axis) for axis in "xyz")
        return None if x is None or y is None or z is None else (x, y, z)


def _at(fields: object, path: Sequence[str]) -> Mapping[str, object]:
    """Return the fields at `path`; none where there is nothing of that kind."""
    for name in path:
        fields = fields.get(name) if isinstance(fields, Mapping) else None
    return fields if isinstance(fields, Mapping) else {}


def _number(fields: Mapping[str, object], name: str) -> float | None:
    """Return a finite number that is not too large; None for anything else."""
    value = fields.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) <= _FAR_M and math.isfinite(value) else None
