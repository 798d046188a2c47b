"""Recordings of strangers: damaged, hostile, or no recordings at all. They are told, and do no harm."""

from __future__ import annotations

import bz2
import os
import random
import struct
import tracemalloc
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped]
import pytest
import zstandard
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as BagWriter

from robochoc.robots.connections import open_source
from robochoc.robots.source import SourceError
from robochoc.ros.message_types import types_of
from robochoc.ros.recordings import recording
from tests.support.cases import looped
from tests.support.examples import count
from tests.support.ros_recordings import (
    FILES,
    NOW,
    POSE,
    TOPICS,
    check,
    messages,
    read,
    write,
)

pytestmark = pytest.mark.usefixtures("in_a_folder")


def mcap_of(kind: str, encoding: str, text: bytes, message: str, content: bytes) -> Path:
    """A file with one message on `/a_1/waypoint`."""
    with Path("other.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema(kind, encoding, text)
        writer.add_message(writer.register_channel("/a_1/waypoint", message, schema), NOW, content, NOW)
        writer.finish()  # type: ignore[no-untyped-call]
    return Path("other.mcap")


def ours() -> bytes:
    return types_of(2).definition(POSE).text.encode()


HOSTILE = (
    b"std_msgs/Header header\n__import__('os').mkdir('harm') pose\nstring x \"'); import os; os.mkdir('harm'); ('\""
)


@looped(
    ("kind", "encoding", "text", "message", "content", "told"),
    lambda: [
        (
            "geometry_msgs/PoseStamped",
            "ros2msg",
            HOSTILE,
            "cdr",
            b"",
            "its definition of geometry_msgs/",
        ),
        ("geometry_msgs/PoseStamped", "ros2msg", b"\xff" * 99, "cdr", b"", "differs from that of ROS 2"),
        ("geometry_msgs/msg/PoseStamped", "ros2msg", b"", "cdr", b"", "differs from that of ROS 2"),
        ("geometry_msgs/msg/PoseStamped", "ros1msg", ours(), "ros1", b"", "differs from that of ROS 1"),
        ("geometry_msgs/PoseStamped", "ros2idl", ours(), "cdr", b"", "encoding 'ros2idl': only ros2msg"),
        ("geometry_msgs/PoseStamped", "ros2msg", ours(), "json", b"{}", "its messages have the encoding 'json'"),
        (
            "geometry_msgs/PoseStamped",
            "ros2msg",
            ours(),
            "cdr",
            bytes(10),
            "10 bytes are not a geometry_msgs",
        ),
        (
            "geometry_msgs/PoseStamped",
            "ros2msg",
            ours(),
            "cdr",
            bytes(999),
            "999 bytes are not a geometry_msgs/",
        ),
    ],
)
def test_definitions_and_messages_that_are_others_are_refused(
    kind: str, encoding: str, text: bytes, message: str, content: bytes, told: str
) -> None:
    file = mcap_of(kind, encoding, text, message, content)
    with pytest.raises(SourceError, match=told) as failed:
        read(file)
    assert str(failed.value).startswith("other.mcap: ")
    assert str(failed.value).isprintable()
    assert [*Path().iterdir()] == [file]


def test_a_type_that_is_defined_in_many_ways_is_refused() -> None:
    with Path("other.mcap").open("wb") as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start("ros2")
        for number in range(100):
            writer.register_schema(POSE, "ros2msg", ours() + b"\n# %d" % number)
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(SourceError, match="it has more than 64 definitions"):
        read("other.mcap")


def test_a_bag_whose_types_are_others_is_refused() -> None:
    with BagWriter("other.bag") as bag:
        found = bag.add_connection(
            "/a_1/waypoint", "geometry_msgs/msg/PoseStamped", msgdef=HOSTILE.decode(), md5sum="0" * 32
        )
        bag.write(found, NOW, b"")
    with pytest.raises(SourceError, match=r"other\.bag: the message on /a_1/waypoint cannot be read: .* MD5 sum '0000"):
        read("other.bag")
    assert [*Path().iterdir()] == [Path("other.bag")]


@pytest.mark.parametrize("text", FILES)
def test_a_file_that_is_cut_anywhere_is_refused(text: str) -> None:
    whole = write(text, messages(20)).read_bytes()
    cut = Path(f"cut.{text.rpartition('.')[2]}")
    for size in {*range(0, len(whole), 211), *range(len(whole) - 20, len(whole))}:
        cut.write_bytes(whole[:size])
        with pytest.raises(SourceError, match=f"^{cut}: "):
            read(cut)


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
        for topic, fields, at in messages(20):
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


@count("tries", 150, 3000)
def test_a_file_that_is_damaged_anywhere_is_read_or_refused(tries: int) -> None:
    files = [*(write(text, messages(20)) for text in FILES), *map(without_checksums, CompressionType)]
    wholes = [(file, file.read_bytes(), read(file)) for file in files]
    chance, ends = random.Random(7), Counter[str]()
    for _ in range(tries):
        file, whole, expected = chance.choice(wholes)
        file.write_bytes(damaged(whole, chance))
        try:
            found = read(file)
        except SourceError as failed:
            told = str(failed)
            ends["refused" if told.startswith(f"{file}: ") and told.isprintable() else "mumbled"] += 1
        else:
            # A bag has no checksums; our MCAP file has one of all that its messages stand in.
            assert file != files[0] or found == expected
            ends["read"] += 1
    assert ends.keys() == {"read", "refused"}
    assert min(ends.values()) > tries // 10


def chunk_of(compression: str, packed: bytes, size: int) -> bytes:
    """An MCAP file of one chunk."""
    name = compression.encode()
    body = struct.pack("<QQQII", 0, 0, size, 0, len(name)) + name + struct.pack("<Q", len(packed)) + packed
    record = struct.pack("<BQ", 6, len(body)) + body
    return b"\x89MCAP0\r\n" + struct.pack("<BQII", 1, 8, 0, 0) + record


def bag_of(compression: str, packed: bytes, size: int) -> bytes:
    """A bag of one chunk."""
    first = fields(op=b"\3", index_pos=struct.pack("<Q", 99), conn_count=bytes(4), chunk_count=b"\1\0\0\0")
    header = fields(op=b"\5", compression=compression.encode(), size=struct.pack("<I", size & 0xFFFFFFFF))
    return b"#ROSBAG V2.0\n" + sized(first) + sized(b"") + sized(header) + sized(packed)


def sized(content: bytes) -> bytes:
    return struct.pack("<I", len(content)) + content


def fields(**values: bytes) -> bytes:
    return b"".join(sized(name.encode() + b"=" + value) for name, value in values.items())


def bombs() -> Iterator[tuple[str, bytes]]:
    """Files of some kilobytes that would like to be gigabytes."""
    packers: dict[str, Callable[[bytes], bytes]] = {
        "zstd": zstandard.ZstdCompressor().compress,
        "lz4": lz4.frame.compress,
        "bz2": bz2.compress,
    }
    large = 1 << 25
    for make, ending, names in ((chunk_of, "mcap", ["zstd", "lz4"]), (bag_of, "bag", ["bz2", "lz4"])):
        for name in names:
            packed = packers[name](bytes(large))
            for size in (1000, large, 1 << 40 if ending == "mcap" else (1 << 32) - 1):
                yield ending, make(name, packed, size)
        yield ending, make("none" if ending == "bag" else "", b"", 1 << 31)
    yield "mcap", chunk_of("zstd", b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", 1 << 62) + bytes(8), 1000)
    yield "mcap", b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, 1 << 62)
    yield "mcap", b"\x89MCAP0\r\n" + struct.pack("<BQHI", 3, 6, 1, 0xFFFFFFFF)
    yield "bag", b"#ROSBAG V2.0\n" + b"\xff" * 99
    yield "bag", b"#ROSBAG V2.0\n" + sized(sized(b"op")) + sized(b"")


def test_bombs_are_refused_and_eat_no_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("recording", "mcap_file"):
        monkeypatch.setattr(f"robochoc.ros.recordings.{module}.BLOCK_BYTES_MAX", 1 << 22)
    read(write(FILES[0], messages(1)))  # what is imported only once is not counted
    for ending, content in bombs():
        file = Path(f"bomb.{ending}")
        file.write_bytes(content)
        tracemalloc.start()
        with pytest.raises(SourceError, match=f"^{file}: "):
            read(file)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 1 << 22


def test_a_file_larger_than_it_says_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.ros.recordings.mcap_file._CHUNK_BYTES", 500)
    file = write(FILES[0], messages(200))
    monkeypatch.setattr(recording, "WAITING_BYTES_MAX", 1000)
    with pytest.raises(SourceError, match="out of order"):
        read(file)
    monkeypatch.setattr(recording, "UNPACKED_BYTES_MAX", 1000)
    monkeypatch.setattr(recording, "_RATIO", 0)
    with pytest.raises(SourceError, match="bytes decompress to"):
        read(file)


@looped(
    ("content", "told"),
    [
        (None, "No such file"),
        (b"", "is not an MCAP file"),
        (b"#ROSBAG V2.0\n", "is not an MCAP file"),
    ],
)
def test_files_that_are_no_recordings(content: bytes | None, told: str) -> None:
    if content is not None:
        Path("run.mcap").write_bytes(content)
    with pytest.raises(SourceError, match=f"run.mcap: {told}"):
        read("run.mcap")


def test_what_is_no_file_is_not_read() -> None:
    os.mkfifo("run.bag")
    Path("run.mcap").mkdir()
    for place, told in (
        ("run.bag", "is not a file"),
        ("rosbag:run.mcap", "is a folder"),
        ("mcap:", "requires a file name"),
    ):
        with pytest.raises(SourceError, match=told):
            open_source(place)
    Path("old.bag").write_bytes(b"#ROSBAG V1.2\n")
    with pytest.raises(SourceError, match=r"another version than 2\.0"):
        read("old.bag")


def test_a_folder_of_ros_2_is_its_recording() -> None:
    file = write(FILES[0], messages(20))
    folder = Path("rosbag2")
    folder.mkdir()
    with pytest.raises(SourceError, match="rosbag2: is a folder without a file"):
        open_source("mcap:rosbag2")
    (folder / "metadata.yaml").touch()
    file.rename(folder / "run_0.mcap")
    check(read("mcap:rosbag2"), messages(20))
    write("mcap:rosbag2/run_1.mcap", messages(20))
    with pytest.raises(SourceError, match=r"rosbag2: has several recordings: .* mcap:rosbag2/run_0\.mcap"):
        open_source("mcap:rosbag2")


def test_a_bag_whose_recording_was_not_finished_is_told() -> None:
    file = write(FILES[1], messages(5))
    whole = file.read_bytes()
    place = whole.index(b"index_pos=") + len(b"index_pos=")
    file.write_bytes(whole[:place] + bytes(8) + whole[place + 8 :])
    with pytest.raises(SourceError, match="rosbag reindex"):
        read(file)
