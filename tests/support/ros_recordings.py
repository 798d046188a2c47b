"""Recordings as tests write and read them."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from robochoc.robots.connections import open_sink, open_source
from robochoc.robots.sink import Fields
from robochoc.robots.source import ReceivedMessage

POSE, BATTERY, TEXT, POINT = (
    "geometry_msgs/PoseStamped",
    "sensor_msgs/BatteryState",
    "std_msgs/String",
    "geometry_msgs/PointStamped",
)
NOW = 1_700_000_000_000_000_000
TOPICS = {"/a_1/waypoint": POSE, "/a_1/battery": BATTERY, "/a_1/out_of_order": TEXT, "/b/blocked": POINT}
ORIGINAL = {"/a_1/waypoint": "/a.1/waypoint"}
FILES = ["mcap:run.mcap", "rosbag:run.bag"]
Said = tuple[str, Fields, int]


def messages(number: int, seed: int = 1) -> list[Said]:
    """So many messages of all types, the times in order."""
    chance = random.Random(seed)
    said: list[Said] = []
    for count in range(number):
        at = NOW + count * 1_000_000
        header = {"stamp": at - 5, "frame_id": "map"}
        place = {axis: chance.uniform(-9, 9) for axis in "xyz"}
        pose = {"position": place, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
        drawn: list[tuple[str, Fields]] = [
            ("/a_1/waypoint", {"header": header, "pose": pose}),
            ("/a_1/battery", {"header": header, "percentage": 0.5, "present": True}),
            ("/a_1/out_of_order", {"data": f"motor {count} ü"}),
            ("/b/blocked", {"header": header, "point": place}),
        ]
        said.append((*chance.choice(drawn), at))
    return said


def write(text: str, said: Sequence[Said], topics: dict[str, str] = TOPICS) -> Path:
    with open_sink(text) as sink:
        sink.explain(ORIGINAL)
        sink.advertise(topics)
        for topic, fields, at in said:
            sink.publish(topic, topics[topic], fields, at)
    return Path(text.split(":")[1])


def read(text: str | Path, topics: dict[str, str] = TOPICS) -> list[ReceivedMessage]:
    with open_source(str(text)) as source:
        source.listen(topics)
        return [*iter(lambda: source.next(0.0), None)]


def part(found: Any, expected: Any) -> Any:  # noqa: ANN401 - fields, or what stands in them
    """Of what was found, no more than was expected."""
    if isinstance(expected, dict):
        return {name: part(found[name], value) for name, value in expected.items()}
    return found


def check(heard: Sequence[ReceivedMessage], said: Sequence[Said]) -> None:
    assert len(heard) == len(said)
    for (topic, fields, at), found in zip(said, heard, strict=True):
        assert (found.topic, found.kind, found.at_ns) == (topic, TOPICS[topic], at)
        assert part(found.fields, fields) == fields
