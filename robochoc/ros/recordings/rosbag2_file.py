"""ROS 2 bags in SQLite (`.db3`), the default format of `ros2 bag record` before MCAP.

The table `topics` has names and types, the table `messages` reception times and messages in CDR. Since ROS 2 Iron,
recorders also write the definitions of types into the table `message_definitions`.
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
"""The first bytes of a compressed message. CDR begins with a zero byte."""
_COLUMNS = {"topics": ("id", "name", "type", "serialization_format"), "messages": ("topic_id", "timestamp", "data")}
_TOPICS_MAX = 1 << 16
_MESSAGES_MAX = 1 << 24
"""The maximum number of messages on the used topics."""
_FIRST, _LAST = 0, 1 << 63
_LIMITS = {
    sqlite3.SQLITE_LIMIT_LENGTH: BLOCK_BYTES_MAX,
    sqlite3.SQLITE_LIMIT_SQL_LENGTH: 1 << 16,
    sqlite3.SQLITE_LIMIT_ATTACHED: 0,
}


class Rosbag2Source(RecordingSource):
    """Reads a ROS 2 bag in SQLite, or the bag in a folder recorded by ROS 2."""

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
        if self._input.read(min(self._input.size, len(_MAGIC)), "its beginning") != _MAGIC:
            raise RecordingDamagedError("is not a ROS 2 bag in SQLite")
        journal = Path(f"{self.place}-wal")
        if journal.exists() and journal.stat().st_size:
            raise RecordingDamagedError(
                f"the recording was not finished: its folder has a file {journal.name}; repair it by `ros2 bag reindex`"
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
        """Return the used topics, by their numbers in the bag."""
        defined = _definitions(rows)
        found = {}
        for number, topic, kind, encoding in rows.execute(
            "SELECT id, name, type, serialization_format FROM topics LIMIT ?", (_TOPICS_MAX,)
        ):
            if not (isinstance(number, int) and isinstance(topic, str) and isinstance(kind, str)):
                raise RecordingDamagedError("a topic has no number, no name or no type")
            if self._is_used(topic, kind):
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
            yield RecordedMessage(at_ns, 0, row, channel, _decompressed(content))


def _open(path: Path) -> sqlite3.Connection:
    """Open the file as read-only and immutable, so that SQLite writes no other file in its folder."""
    rows = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True, check_same_thread=False)
    for limit, most in _LIMITS.items():
        rows.setlimit(limit, most)
    rows.execute("PRAGMA trusted_schema = OFF")
    rows.execute("PRAGMA cell_size_check = ON")
    return rows


def _check(rows: sqlite3.Connection) -> None:
    """Check the file's integrity, and that it has no views or triggers, which could run arbitrary computations."""
    parts = rows.execute("SELECT name, type, coalesce(sql, '') FROM sqlite_master LIMIT 1000").fetchall()
    if any(kind in {"view", "trigger"} or str(sql).casefold().startswith("create virtual") for _, kind, sql in parts):
        raise RecordingDamagedError("it has views, triggers or virtual tables, which are not allowed in a bag")
    tables = {name for name, kind, _ in parts if kind == "table"}
    for table, columns in _COLUMNS.items():
        # Computed columns are hidden: their last value in the table's description is not 0.
        plain = {row[1] for row in rows.execute(f"PRAGMA table_xinfo({table})") if row[6] == 0}
        if table not in tables or not {*columns} <= plain:
            raise RecordingDamagedError(f"is not a ROS 2 bag: it has no table {table!r} with {', '.join(columns)}")
    (result,) = rows.execute("PRAGMA integrity_check(1)").fetchone()
    if result != "ok":
        raise RecordingDamagedError(f"it is damaged: {result}")


def _definitions(rows: sqlite3.Connection) -> dict[str, str]:
    """Return the definitions in the bag, by type; empty for bags from before ROS 2 Iron."""
    columns = {row[1] for row in rows.execute("PRAGMA table_xinfo(message_definitions)") if row[6] == 0}
    if not {"topic_type", "encoding", "encoded_message_definition"} <= columns:
        return {}
    query = "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg' LIMIT ?"
    return {str(kind): str(text) for kind, text in rows.execute(query, (_TOPICS_MAX,)) if text}


def _fault(kind: str, encoding: object, text: str | None) -> str:
    """Return the reason why messages of a type cannot be read; empty if they can be read."""
    if encoding != "cdr":
        return f"its messages have the encoding {str(encoding)[:40]!r}"
    if text is not None and not types_of(2).has_same_fields(kind, text):
        return f"its definition of {kind} differs from that of ROS 2"
    return ""


def _in_order(rows: sqlite3.Connection, channels: dict[int, RecordedChannel]) -> list[tuple[int, int]]:
    """Return the time and the row of each used message, sorted by time."""
    found: list[tuple[int, int]] = []
    for row, number, at_ns in rows.execute("SELECT rowid, topic_id, timestamp FROM messages"):
        if number not in channels:
            continue
        if not isinstance(at_ns, int) or not _FIRST <= at_ns < _LAST:
            raise RecordingDamagedError(f"message {row} has no valid time")
        if len(found) == _MESSAGES_MAX:
            raise RecordingDamagedError(f"it has more than {_MESSAGES_MAX} messages on these topics")
        found.append((at_ns, row))
    return sorted(found)


def _decompressed(content: bytes) -> bytes:
    """Return the decompressed content of a message. Recorders may compress each message separately."""
    if not content.startswith(_ZSTD):
        return content
    try:
        with closing(zstandard.ZstdDecompressor(max_window_size=BLOCK_BYTES_MAX).stream_reader(content)) as stream:
            plain = stream.read(BLOCK_BYTES_MAX + 1)
    except zstandard.ZstdError as error:
        raise RecordingDamagedError(f"a message cannot be decompressed: {error}") from error
    if len(plain) > BLOCK_BYTES_MAX:
        raise RecordingDamagedError(f"a message decompresses to more than {BLOCK_BYTES_MAX:,} bytes: that is too much")
    return plain


@contextmanager
def _as_damage() -> Iterator[None]:
    """Convert errors of SQLite and UTF-8 decoding to `RecordingDamagedError`."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise RecordingDamagedError(f"it is damaged: {error}") from error
