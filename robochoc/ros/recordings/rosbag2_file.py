"""Bags of ROS 2 in SQLite (`.db3`), as `ros2 bag record` made them by default before it made MCAP files.

The table `topics` has their names and types, the table `messages` has when each was received, and its CDR. Recorders
from ROS 2 Iron on write the definitions of types into a table of their own, `message_definitions`.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import zstandard

from robochoc.ros.message_types import types_of
from robochoc.ros.recordings.recording import (
    BLOCK_BYTES_MAX,
    RecordedChannel,
    RecordedMessage,
    RecordingDamagedError,
    RecordingSource,
    recording_in_folder,
)
from robochoc.ros.waypoint_types import short_kind

_MAGIC = b"SQLite format 3\0"
_ZSTD = b"\x28\xb5\x2f\xfd"
"""The first bytes of a compressed message; CDR begins with a zero."""
_COLUMNS = {"topics": ("id", "name", "type", "serialization_format"), "messages": ("topic_id", "timestamp", "data")}
_TOPICS_MAX = 1 << 16
_MESSAGES_MAX = 1 << 24
"""Messages on the topics that are wanted."""
_FIRST, _LAST = 0, 1 << 63
_LIMITS = {
    sqlite3.SQLITE_LIMIT_LENGTH: BLOCK_BYTES_MAX,
    sqlite3.SQLITE_LIMIT_SQL_LENGTH: 1 << 16,
    sqlite3.SQLITE_LIMIT_ATTACHED: 0,
}


class Rosbag2Source(RecordingSource):
    """Reads a bag of ROS 2 in SQLite, or the one in a folder that ROS 2 has recorded."""

    def __init__(self, place: str) -> None:
        super().__init__(recording_in_folder(place, "rosbag2", ".db3", "mcap:FOLDER reads the .mcap of ROS 2"))
        self._rows: sqlite3.Connection | None = None

    def close(self) -> None:
        """Close the file."""
        super().close()
        if self._rows is not None:
            self._rows.close()

    def _read_messages(self) -> Iterator[RecordedMessage]:
        self._input.rewind()
        if self._input.take(min(self._input.size, len(_MAGIC)), "its beginning") != _MAGIC:
            raise RecordingDamagedError("is not a ROS 2 bag in SQLite")
        journal = Path(f"{self.place}-wal")
        if journal.exists() and journal.stat().st_size:
            raise RecordingDamagedError(
                f"its recording was not finished, as {journal.name} stands beside it: `ros2 bag reindex` mends that"
            )
        if self._rows is not None:
            self._rows.close()
        with _as_damage():
            self._rows = rows = _open(Path(self.place))
            _check(rows)
            channels = self._channels(rows)
            order = _in_order(rows, channels)
        return self._messages_of(rows, channels, order)

    def _channels(self, rows: sqlite3.Connection) -> dict[int, RecordedChannel]:
        """Return the wanted topics by the bag's numbers."""
        defined = _definitions(rows)
        found = {}
        for number, topic, kind, encoding in rows.execute(
            "SELECT id, name, type, serialization_format FROM topics LIMIT ?", (_TOPICS_MAX,)
        ):
            if not (isinstance(number, int) and isinstance(topic, str) and isinstance(kind, str)):
                raise RecordingDamagedError("a topic has no number, no name or no type")
            if self._wanted(topic, kind):
                found[number] = RecordedChannel(topic, 2, _fault(short_kind(kind), encoding, defined.get(kind)))
        return found

    def _messages_of(
        self, rows: sqlite3.Connection, channels: dict[int, RecordedChannel], order: list[tuple[int, int]]
    ) -> Iterator[RecordedMessage]:
        for at_ns, row in order:
            with _as_damage():
                found = rows.execute("SELECT topic_id, data FROM messages WHERE rowid = ?", (row,)).fetchone()
            number, content = found or (None, None)
            channel = channels.get(number) if isinstance(number, int) else None
            if channel is None or not isinstance(content, bytes):
                raise RecordingDamagedError(f"message {row} has no topic or no content")
            if channel.fault:
                raise RecordingDamagedError(f"the message on {channel.topic} cannot be read: {channel.fault}")
            yield RecordedMessage(at_ns, 0, row, channel, _unpacked(content))


def _open(path: Path) -> sqlite3.Connection:
    """Open the file only to read, as it stands: nothing is written, not even beside it."""
    rows = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True, check_same_thread=False)
    for limit, most in _LIMITS.items():
        rows.setlimit(limit, most)
    rows.execute("PRAGMA trusted_schema = OFF")
    rows.execute("PRAGMA cell_size_check = ON")
    return rows


def _check(rows: sqlite3.Connection) -> None:
    """Check that the file is whole, and that its tables are tables: a view or a trigger may compute anything."""
    parts = rows.execute("SELECT name, type, coalesce(sql, '') FROM sqlite_master LIMIT 1000").fetchall()
    if any(kind in {"view", "trigger"} or str(sql).casefold().startswith("create virtual") for _, kind, sql in parts):
        raise RecordingDamagedError("it has views, triggers or virtual tables, which no bag has")
    tables = {name for name, kind, _ in parts if kind == "table"}
    for table, columns in _COLUMNS.items():
        # A column whose value is computed is hidden, and has another number than 0 there.
        plain = {row[1] for row in rows.execute(f"PRAGMA table_xinfo({table})") if row[6] == 0}
        if table not in tables or not {*columns} <= plain:
            raise RecordingDamagedError(f"is not a ROS 2 bag: it has no table {table!r} with {', '.join(columns)}")
    (told,) = rows.execute("PRAGMA integrity_check(1)").fetchone()
    if told != "ok":
        raise RecordingDamagedError(f"it is damaged: {told}")


def _definitions(rows: sqlite3.Connection) -> dict[str, str]:
    """Return the definitions that the bag has, by type; none in bags of ROS 2 before Iron."""
    columns = {row[1] for row in rows.execute("PRAGMA table_xinfo(message_definitions)") if row[6] == 0}
    if not {"topic_type", "encoding", "encoded_message_definition"} <= columns:
        return {}
    wanted = "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg' LIMIT ?"
    return {str(kind): str(text) for kind, text in rows.execute(wanted, (_TOPICS_MAX,)) if text}


def _fault(kind: str, encoding: object, text: str | None) -> str:
    """Return why messages of a type cannot be read; empty if they can."""
    if encoding != "cdr":
        return f"its messages are written as {str(encoding)[:40]!r}"
    if text is not None and not types_of(2).has_same_fields(kind, text):
        return f"its definition of {kind} is not that of ROS 2"
    return ""


def _in_order(rows: sqlite3.Connection, channels: dict[int, RecordedChannel]) -> list[tuple[int, int]]:
    """Return the time and the row of each wanted message, in the order of the times."""
    found: list[tuple[int, int]] = []
    for row, number, at_ns in rows.execute("SELECT rowid, topic_id, timestamp FROM messages"):
        if number not in channels:
            continue
        if not isinstance(at_ns, int) or not _FIRST <= at_ns < _LAST:
            raise RecordingDamagedError(f"message {row} has no time")
        if len(found) == _MESSAGES_MAX:
            raise RecordingDamagedError(f"it has more than {_MESSAGES_MAX} messages on these topics")
        found.append((at_ns, row))
    return sorted(found)


def _unpacked(content: bytes) -> bytes:
    """Return a message, which recorders may compress one by one."""
    if not content.startswith(_ZSTD):
        return content
    try:
        with closing(zstandard.ZstdDecompressor(max_window_size=BLOCK_BYTES_MAX).stream_reader(content)) as stream:
            unpacked = stream.read(BLOCK_BYTES_MAX + 1)
    except zstandard.ZstdError as error:
        raise RecordingDamagedError(f"a message cannot be unpacked: {error}") from error
    if len(unpacked) > BLOCK_BYTES_MAX:
        raise RecordingDamagedError(f"a message unpacks to more than {BLOCK_BYTES_MAX} bytes, which are not read")
    return unpacked


@contextmanager
def _as_damage() -> Iterator[None]:
    """Raise SQLite's errors, and texts that are no UTF-8, as `RecordingDamagedError`."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise RecordingDamagedError(f"it is damaged: {error}") from error
