"""Decodes the reports of robots from messages of ROS 1 or ROS 2.

A drone reports in its own namespace (`names.py`). Messages are untrusted. Invalid messages are ignored, for example
with a value that is not a number, or a place in another frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from robochoc.flight.layout import Point
from robochoc.flight.mission import Drone
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
from robochoc.robots.source import REPORTS, ReceivedMessage
from robochoc.ros.names import TopicNames

REASON_MAX = 200
"""The maximum length of a reason, in characters; longer reasons are truncated."""
_COORDINATE_MAX_M = 1e9
"""The largest valid coordinate, in metres."""


class ReportDecoder:
    """Decodes the reports of `drones`. Raises `NameClashError` if two of their topics would have the same name.

    Only places in `frame` are accepted. Places in messages without a frame are assumed to be in `frame`.
    """

    topics: Mapping[str, str]
    """The ROS names of report topics, with the ROS names of their types."""
    namespaces: Mapping[str, str]
    """The namespace of each drone's topics, by the drone's name."""
    other_frames: dict[str, str]
    """The topics with places in another frame, each with the last such frame."""

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
        """Return the report in a message, with the time of reception; None if there is no valid report."""
        drone, token = self._tokens.get(received.topic, ("", ""))
        at_s = received.at_ns / 1e9
        match token:
            case "battery":
                level = _number(received.fields, "percentage")
                return None if level is None else BatteryReport(drone, level, at_s)
            case "out_of_order":
                why = received.fields.get("data")
                return OutOfOrderReport(drone, on_one_line(why[:REASON_MAX]) if isinstance(why, str) else "", at_s)
            case "done":
                task = received.fields.get("data")
                return DoneReport(drone, task, at_s) if isinstance(task, str) and len(task) <= REASON_MAX else None
            case "pose":
                place = self._place(received, "pose", "position")
                return None if place is None else PoseReport(drone, place, at_s)
            case "blocked" | "cleared":
                place = self._place(received, "point")
                kind = ClearedReport if received.topic.endswith("/cleared") else BlockedReport
                return None if place is None else kind(drone, place, at_s)
            case _:
                return None

    def _place(self, received: ReceivedMessage, *path: str) -> Point | None:
        """Return the point at `path` in the message; None if the point is invalid or in another frame."""
        frame = _fields_at(received.fields, ("header",)).get("frame_id")
        if isinstance(frame, str) and frame.removeprefix("/") not in {"", self._frame}:
            self.other_frames[received.topic] = on_one_line(frame[:REASON_MAX])
            return None
        fields = _fields_at(received.fields, path)
        x, y, z = (_number(fields, axis) for axis in "xyz")
        return None if x is None or y is None or z is None else (x, y, z)


def _fields_at(fields: object, path: Sequence[str]) -> Mapping[str, object]:
    """Return the nested fields at `path`; empty if there are none."""
    for name in path:
        fields = fields.get(name) if isinstance(fields, Mapping) else None
    return fields if isinstance(fields, Mapping) else {}


def _number(fields: Mapping[str, object], name: str) -> float | None:
    """Return the number in the field `name`; None if it is not a finite number, or too large."""
    value = fields.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) <= _COORDINATE_MAX_M and math.isfinite(value) else None
