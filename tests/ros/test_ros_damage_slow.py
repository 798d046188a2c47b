"""Recordings, for longer: damage of all kinds, and a flight of 121 drones."""

from __future__ import annotations

import random
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from robochoc.flight.mission import Drone
from robochoc.model.problem import Topic
from robochoc.ros.publisher import Publisher
from robochoc.ros.recordings.types import types_of
from robochoc.ros.sinks import open_sink
from robochoc.ros.source import SourceError
from tests.support.ros_recordings import FILES, TOPICS, messages, read, write

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("in_a_folder")]

SIDE, STEPS = 11, 300
SECONDS = 20.0


def without_checksums(compression: CompressionType) -> Path:
    """An MCAP file in which damage goes deeper."""
    file = Path(f"{compression.name}.mcap")
    with file.open("wb") as stream:
        writer = Writer(stream, 700, compression, enable_crcs=False)
        writer.start("ros2")
        channels = {}
        for topic, kind in TOPICS.items():
            schema = writer.register_schema(kind, "ros2msg", types_of(2).definition(kind).text.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for topic, fields, at in messages(30):
            writer.add_message(channels[topic], at, types_of(2).encode(TOPICS[topic], fields), at)
        writer.finish()  # type: ignore[no-untyped-call]
    return file


def damaged(whole: bytes, chance: random.Random) -> bytes:
    bad = bytearray(whole)
    for _ in range(chance.choice([1, 1, 2, 8])):
        place, how = chance.randrange(len(bad)), chance.random()
        if how < 0.6:
            bad[place] = chance.choice([0, 1, 127, 128, 255, chance.randrange(256)])
        elif how < 0.8:
            del bad[place : place + chance.randrange(1, 20)]
        else:
            bad[place:place] = chance.randbytes(chance.randrange(20))
    return bytes(bad)


def test_damage_of_all_kinds_is_told_or_harmless() -> None:
    files = [*(write(text, messages(30)) for text in FILES), *map(without_checksums, CompressionType)]
    wholes = [(file, file.read_bytes()) for file in files]
    chance = random.Random(11)
    ends: Counter[str] = Counter()
    until = time.monotonic() + SECONDS
    while time.monotonic() < until:
        file, whole = chance.choice(wholes)
        file.write_bytes(damaged(whole, chance))
        try:
            read(file)
            ends["read"] += 1
        except SourceError as failed:
            ends["refused" if str(failed).startswith(f"{file}: ") and str(failed).isprintable() else "mumbled"] += 1
    assert not ends["mumbled"]
    assert ends["read"] > 100
    assert ends["refused"] > 100


@pytest.mark.parametrize("text", FILES)
def test_a_flight_of_121_drones_is_read_as_it_was_written(text: str) -> None:
    drones = [
        Drone(f"drone{x}.{y}", f"Robot{x}.{y}", Topic(f"/drone{x}.{y}/waypoint{x}.{y}"), (x, y, 0.0), x)
        for x in range(1, SIDE + 1)
        for y in range(1, SIDE + 1)
    ]
    positions = np.random.default_rng(1).normal(size=(STEPS, len(drones), 3))
    attitudes = np.tile([0.0, 0.0, 0.0, 1.0], (len(drones), 1))
    begun = time.monotonic()
    with open_sink(text) as sink:
        publisher = Publisher("queens", drones, [sink])
        for step, places in enumerate(positions):
            publisher.poses(places, attitudes, step * 33_333_333)
    took = time.monotonic() - begun
    topics = {topic: kind for topic, kind in publisher.names.reports().items() if topic.endswith("/pose")}
    heard = read(text, topics)
    place = Path(text.partition(":")[2])
    print(f"{len(heard) / took:.0f} PoseStamped a second, {place.stat().st_size / len(heard):.0f} bytes each")  # noqa: T201
    found = [[each.fields["pose"]["position"][axis] for axis in "xyz"] for each in heard]
    assert np.array_equal(np.reshape(found, positions.shape), positions)
