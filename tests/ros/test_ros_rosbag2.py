"""Bags of ROS 2 in SQLite, written by rosbags: what is in them, and damage that is told."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Literal

import pytest
import zstandard
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from robochoc.robots.sink import Fields
from robochoc.robots.source import SourceError
from robochoc.ros.message_types import types_of
from tests.support.cases import looped
from tests.support.ros_recordings import POINT, TOPICS, check, messages, read

pytestmark = pytest.mark.usefixtures("in_a_folder")

FILE = Path("other/other.db3")
READ = f"rosbag2:{FILE}"


def written(version: Literal[8, 9] = 9) -> list[tuple[str, Fields, int]]:
    """A bag with some messages, which are returned. Version 9 has definitions of its types in the file."""
    said = messages(60)
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer("other", version=version, storage_plugin=StoragePlugin.SQLITE3) as bag:
        found = {
            topic: bag.add_connection(topic, kind.replace("/", "/msg/"), typestore=store)
            for topic, kind in TOPICS.items()
        }
        for topic, fields, at in reversed(said):
            bag.write(found[topic], at, types_of(2).encode(TOPICS[topic], fields))
    return said


def changed(*statements: str) -> None:
    """Change the bag by SQL."""
    with closing(sqlite3.connect(FILE)) as rows:
        for statement in statements:
            rows.execute(statement)
        rows.commit()


@pytest.mark.parametrize("version", [8, 9])
def test_bags_of_others_are_read_in_the_order_of_their_times(version: Literal[8, 9]) -> None:
    said = written(version)
    before = FILE.read_bytes()
    check(read(READ), said)
    check(read(str(FILE)), said)  # the name's end is enough
    check(read("rosbag2:other"), said)  # as ros2 bag names it: the folder
    check(read(READ, {"/b/blocked": POINT}), [each for each in said if each[0] == "/b/blocked"])
    assert FILE.read_bytes() == before
    assert {path.name for path in FILE.parent.iterdir()} == {"other.db3", "metadata.yaml"}


def test_messages_that_are_compressed_one_by_one() -> None:
    said = written()
    with closing(sqlite3.connect(FILE)) as rows:
        for number, content in rows.execute("SELECT id, data FROM messages").fetchall():
            rows.execute("UPDATE messages SET data = ? WHERE id = ?", (zstandard.compress(content), number))
        rows.commit()
    check(read(READ), said)


@looped(
    ("statement", "told"),
    [
        ("DROP TABLE messages", "no table 'messages'"),
        ("ALTER TABLE topics RENAME COLUMN name TO title", "no table 'topics' with id, name"),
        ("CREATE VIEW more AS SELECT * FROM messages", "views, triggers or virtual tables"),
        ("CREATE VIRTUAL TABLE more USING fts5(text)", "views, triggers or virtual tables"),
        ("UPDATE topics SET serialization_format = 'xml'", "its messages have the encoding 'xml'"),
        ("UPDATE messages SET timestamp = -1", "has no valid time"),
        ("UPDATE messages SET data = 7", "no topic or no content"),
        ("UPDATE messages SET data = x'0001'", "cannot be read"),
        ("UPDATE messages SET data = x'28b52ffd00ff'", "cannot be decompressed"),
        ("UPDATE message_definitions SET encoded_message_definition = 'int8 lies'", "differs from that of ROS 2"),
    ],
)
def test_what_is_no_bag_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, statement: str, told: str) -> None:
    monkeypatch.chdir(tmp_path)
    written()
    changed(statement)
    with pytest.raises(SourceError, match=told):
        read(READ)


def test_a_large_message_is_not_unpacked() -> None:
    written()
    bomb = zstandard.ZstdCompressor(level=19).compress(bytes((1 << 26) + 1))
    with closing(sqlite3.connect(FILE)) as rows:
        rows.execute("UPDATE messages SET data = ?", (bomb,))
        rows.commit()
    with pytest.raises(SourceError, match="decompresses to more than 67,108,864 bytes"):
        read(READ)


def test_damage_is_found_before_anything_is_acted_upon() -> None:
    written()
    content = bytearray(FILE.read_bytes())
    content[4096 + 3 : 4096 + 40] = bytes(37)
    FILE.write_bytes(content)
    with pytest.raises(SourceError, match="it is damaged"):
        read(READ)
    FILE.write_bytes(b"SQLite format 3\0")
    with pytest.raises(SourceError, match="it is damaged"):
        read(READ)
    FILE.write_bytes(b"no bag")
    with pytest.raises(SourceError, match="is not a ROS 2 bag in SQLite"):
        read(READ)


def test_a_recording_that_was_not_finished() -> None:
    written()
    Path(f"{FILE}-wal").write_bytes(b"more")
    with pytest.raises(SourceError, match=r"was not finished: its folder has a file other\.db3-wal"):
        read(READ)


def test_folders_without_a_bag_and_with_several() -> None:
    Path("empty").mkdir()
    with pytest.raises(SourceError, match=r"without a file \*.db3: mcap:FOLDER"):
        read("rosbag2:empty")
    written()
    Path("other/more.db3").write_bytes(FILE.read_bytes())
    with pytest.raises(SourceError, match=r"has several recordings: name one, such as rosbag2:other/more.db3"):
        read("rosbag2:other")
