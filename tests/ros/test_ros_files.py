"""Recordings: the reference readers and we read back what is written; what goes wrong is told, and leaves nothing."""

from __future__ import annotations

import errno
import os
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag1 import Reader as BagReader
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

from robochoc.robots.connections import UnknownSinkError, UnknownSourceError, open_sink, open_source
from robochoc.robots.sink import SinkError
from robochoc.ros.message_types import types_of
from robochoc.ros.recordings.mcap_file import NAMES
from tests.support.cases import looped
from tests.support.program import unmeasured
from tests.support.ros_recordings import (
    FILES,
    NOW,
    ORIGINAL,
    POINT,
    POSE,
    TEXT,
    TOPICS,
    check,
    messages,
    part,
    read,
    write,
)

pytestmark = pytest.mark.usefixtures("in_a_folder")


def attributes(message: Any) -> Any:  # noqa: ANN401 - whatever a reference makes of it
    """A message of a reference reader as fields."""
    if type(message).__name__.endswith("Time"):
        return message.sec * 10**9 + message.nanosec
    names = getattr(message, "__slots__", None) or getattr(message, "__dataclass_fields__", None)
    return {name: attributes(getattr(message, name)) for name in names} if names else message


@looped("text", FILES)
@looped("number", [0, 1, 500])
def test_what_is_written_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, number: int) -> None:
    monkeypatch.chdir(tmp_path)
    said = messages(number)
    file = write(text, said)
    check(read(text), said)
    check(read(file), said)
    assert [*Path().iterdir()] == [file]


@pytest.mark.parametrize("text", FILES)
def test_the_same_messages_make_the_same_bytes(text: str) -> None:
    first = write(text, messages(300)).read_bytes()
    assert write(text, messages(300)).read_bytes() == first
    assert write(text, messages(300, seed=2)).read_bytes() != first


def test_the_reference_reads_an_mcap_file() -> None:
    said = messages(400)
    with write(FILES[0], said).open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        found = [*reader.iter_decoded_messages()]
        assert [(record.name, record.metadata) for record in reader.iter_metadata()] == [(NAMES, ORIGINAL)]
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(said)
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count > 0
        stream.seek(0)
        assert sum(1 for _ in StreamReader(stream, validate_crcs=True).records) > len(said)
    for (schema, channel, message, decoded), (topic, fields, at) in zip(found, said, strict=True):
        assert schema is not None
        assert (schema.name, schema.encoding) == (TOPICS[topic].replace("/", "/msg/"), "ros2msg")
        assert (channel.topic, channel.message_encoding) == (topic, "cdr")
        assert channel.metadata == ({"original": ORIGINAL[topic]} if topic in ORIGINAL else {})
        assert (message.log_time, message.publish_time) == (at, at)
        assert part(attributes(decoded), fields) == fields


def test_rosbags_reads_a_bag() -> None:
    said = messages(400)
    store = get_typestore(Stores.ROS1_NOETIC)
    counts: dict[str, int] = {}
    with BagReader(write(FILES[1], said)) as bag:
        for (connection, at, content), (topic, fields, when) in zip(bag.messages(), said, strict=True):
            assert (connection.topic, at) == (topic, when)
            assert connection.msgtype == TOPICS[topic].replace("/", "/msg/")
            found = attributes(store.deserialize_ros1(content, connection.msgtype))
            assert part(found, fields) == fields
            counts[topic] = counts.get(topic, 0) + 1
            assert topic == "/a_1/out_of_order" or found["header"]["seq"] == counts[topic]


@pytest.mark.parametrize("text", FILES)
def test_messages_come_in_the_order_of_their_times(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.ros.recordings.mcap_file._CHUNK_BYTES", 500)
    said = messages(300)
    shuffled = random.Random(3).sample(said, len(said))
    write(text, shuffled)
    check(read(text), said)
    only = {"/b/blocked": POINT}
    check(read(text, only), [each for each in said if each[0] == "/b/blocked"])


@pytest.mark.parametrize("text", FILES)
def test_what_has_another_type_is_passed_over(text: str) -> None:
    write(text, messages(50))
    assert read(text, {"/a_1/battery": TEXT, "/nobody": POSE}) == []


@looped("compression", [*CompressionType])
@looped("chunked", [True, False])
@looped("ros", [1, 2])
def test_mcap_files_of_others(compression: CompressionType, ros: int, *, chunked: bool) -> None:
    types = types_of(1 if ros == 1 else 2)
    said = messages(60)
    with Path("other.mcap").open("wb") as stream:
        writer = Writer(stream, 700, compression, IndexType.NONE, use_chunking=chunked, repeat_channels=False)
        writer.start(f"ros{ros}")
        writer.add_attachment(0, 0, "scene.jpg", "image/jpeg", bytes(3_000_000))
        channels = {}
        for topic, kind in TOPICS.items():
            schema = writer.register_schema(kind, f"ros{ros}msg", types.definition(kind).text.encode())
            channels[topic] = writer.register_channel(topic, "ros1" if ros == 1 else "cdr", schema)
        for topic, fields, at in said:
            writer.add_message(channels[topic], at, types.encode(TOPICS[topic], fields), at)
        writer.finish()  # type: ignore[no-untyped-call]
    check(read("other.mcap"), said)


@looped("compression", [None, *BagWriter.CompressionFormat])
def test_bags_of_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: BagWriter.CompressionFormat | None
) -> None:
    monkeypatch.chdir(tmp_path)
    said = messages(60)
    bag = BagWriter("other.bag")
    bag.chunk_threshold = 700
    if compression:
        bag.set_compression(compression)
    with bag:
        store = get_typestore(Stores.ROS1_NOETIC)
        found = {
            topic: bag.add_connection(topic, kind.replace("/", "/msg/"), typestore=store)
            for topic, kind in TOPICS.items()
        }
        for topic, fields, at in said:
            bag.write(found[topic], at, types_of(1).encode(TOPICS[topic], fields))
    check(read("other.bag"), said)


def interrupted(text: str, error: type[BaseException]) -> None:
    with open_sink(text) as sink:
        sink.publish("/a_1/waypoint", POSE, {}, NOW)
        raise error


@pytest.mark.parametrize("text", FILES)
def test_an_error_leaves_nothing_behind(text: str) -> None:
    for error in (ValueError, KeyboardInterrupt):
        with pytest.raises(error):
            interrupted(text, error)
    assert not [*Path().iterdir()]


@pytest.mark.parametrize("text", FILES)
def test_the_old_file_stands_until_the_new_one_is_whole(text: str) -> None:
    file = write(text, messages(5))
    old = file.read_bytes()
    with open_sink(text) as sink:
        sink.publish("/a_1/waypoint", POSE, {}, NOW)
        assert file.read_bytes() == old
    assert file.read_bytes() != old
    assert [*Path().iterdir()] == [file]


@pytest.mark.parametrize("text", FILES)
def test_files_that_cannot_be_written(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name, _, place = text.partition(":")
    for where, told in (
        (f"no/where/{place}", "create it first"),
        (".", "Is a directory"),
        ("", "requires a file name"),
        ("/dev/null", "is not a regular file"),
    ):
        with pytest.raises(SinkError, match=told):
            open_sink(f"{name}:{where}")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    sink = open_sink(text)
    sink.publish("/a_1/waypoint", POSE, {}, NOW)
    monkeypatch.setattr("robochoc.system.files._linked", full)
    with pytest.raises(SinkError, match=f"{place}: No space left"):
        sink.close()
    assert not [*Path().iterdir()]


@pytest.mark.more
@pytest.mark.parametrize("text", FILES)
def test_a_full_disk_is_told_and_nothing_is_left(text: str) -> None:
    """The process may write 40 kB to a file: its next write fails."""
    program = f"""
import resource, signal, sys
from robochoc.robots.sink import SinkError
from robochoc.robots.connections import open_sink
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))
import random
try:
    with open_sink({text!r}) as sink:
        for at in range(20_000):
            point = {{"point": {{"x": random.random(), "y": random.random()}}}}
            sink.publish("/b", "geometry_msgs/PointStamped", point, at)
except SinkError as failed:
    print(failed)
"""
    command = [sys.executable, "-W", "error", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=unmeasured())
    assert done.stdout == f"{text.split(':')[1]}: File too large\n"
    assert not done.stderr
    assert not [*Path().iterdir()]


@pytest.mark.more
@pytest.mark.parametrize("text", FILES)
def test_not_even_a_kill_leaves_a_trace(text: str) -> None:
    program = f"""
import os
from robochoc.robots.connections import open_sink
sink = open_sink({text!r})
for at in range(20_000):
    sink.publish("/b", "geometry_msgs/PointStamped", {{}}, at)
print(os.listdir())
os.kill(os.getpid(), 9)
"""
    done = subprocess.run([sys.executable, "-u", "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-9, "[]\n", "")
    assert not [*Path().iterdir()]


@pytest.mark.parametrize("text", FILES)
def test_systems_without_unnamed_files(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.system.files._linked", lambda *_: None)
    check(read(write(text, messages(20))), messages(20))
    monkeypatch.delattr(os, "O_TMPFILE")
    check(read(write(text, messages(30))), messages(30))
    with pytest.raises(KeyboardInterrupt):
        interrupted(text, KeyboardInterrupt)
    assert len([*Path().iterdir()]) == 1


@pytest.mark.parametrize("text", FILES)
def test_what_cannot_be_published_is_told_with_its_topic(text: str) -> None:
    with open_sink(text) as sink:
        with pytest.raises(SinkError, match=r": /a: .*PoseStamped: pose\.x is not a field"):
            sink.publish("/a", POSE, {"pose": {"x": 1.0}}, NOW)
        with pytest.raises(SinkError, match="/a: the time -1 ns cannot be recorded"):
            sink.publish("/a", POSE, {}, -1)
        with pytest.raises(SinkError, match=r"/a: .*no type 'my_msgs/Unheard'"):
            sink.advertise({"/a": "my_msgs/Unheard"})


@looped(
    ("text", "told"),
    [
        ("mcpa:run.mcap", "no sink 'mcpa' is installed, only: .*did you mean 'mcap'"),
        ("run.txt", "no sink 'run.txt'"),
        ("", "a sink is written NAME:PLACE"),
        (":run.mcap", "no sink ''"),
        ("dds?wait=3", r"no sink 'dds\?wait=3' .*; options follow a colon: dds:\?wait=3"),
    ],
)
def test_sinks_that_there_are_not(text: str, told: str) -> None:
    with pytest.raises(UnknownSinkError, match=told):
        open_sink(text)
    with pytest.raises(UnknownSourceError, match=told.replace("sink", "source")):
        open_source(text)


def test_an_extra_that_is_not_installed_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "robochoc.ros.recordings.mcap_file", raising=False)
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(
        UnknownSinkError, match=r"mcap needs mcap.writer, which is not installed: pip install 'robochoc\[mcap\]'"
    ):
        open_sink("mcap:run.mcap")


def test_an_extra_with_another_spelling_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Metadata has `rmw-zenoh` for the extra `rmw_zenoh`."""
    for name in ("rmw_zenoh", "rmw_zenoh_session"):
        monkeypatch.delitem(sys.modules, f"robochoc.ros.live.{name}", raising=False)
    monkeypatch.setitem(sys.modules, "zenoh", None)
    with pytest.raises(
        UnknownSinkError, match=r"rmw_zenoh needs zenoh, which is not installed: pip install 'robochoc\[rmw.zenoh\]'"
    ):
        open_sink("rmw_zenoh")
