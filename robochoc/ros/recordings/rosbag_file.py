"""ROS 1 bags, version 2.0 (wiki.ros.org/Bags/Format/2.0), for `rosbag play`.

Bags are written without compression, as by `rosbag record`.
"""

from __future__ import annotations

import bz2
import os
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, NamedTuple, cast

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer

from robochoc.robots.sink import Fields
from robochoc.ros.message_types import types_of
from robochoc.ros.recordings.recording import (
    ChunkedRecordingSource,
    MessageBlock,
    RecordedChannel,
    RecordingDamagedError,
    RecordingSink,
    decompress_lz4,
    uncompressed,
)
from robochoc.ros.waypoint_types import short_kind

_CALLER = "/robochoc"
_MAGIC = b"#ROSBAG V2.0\n"
_HEADER_AT_MOST = 1 << 20
_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7
_SIZE = struct.Struct("<I")
_LAYOUTS = {b"op": "<B", b"conn": "<I", b"size": "<I", b"time": "<II", b"index_pos": "<Q"}
_LAYOUTS |= {b"conn_count": "<I", b"chunk_count": "<I"}


class RosbagSink(RecordingSink):
    """Writes a ROS 1 bag. The same messages always give the same bytes."""

    example = "rosbag:run.bag"
    version = 1

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._connections: dict[tuple[str, str], Connection] = {}
        self._sequence: dict[int, int] = {}
        with self.as_sink_errors():
            self._writer = Writer(Path(place) / "bag")  # the library requires a path that does not exist
            self._writer.path = cast("Path", _OpenFile(self.file.stream))
            self._writer.open()

    def write(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Append a message. Headers are numbered per topic, as in ROS 1."""
        found = self._connections.get((topic, kind)) or self._connection(topic, kind)
        self._sequence[found.id] = sequence = self._sequence.get(found.id, 0) + 1
        header = fields.get("header")
        if isinstance(header, dict):
            fields = {**fields, "header": {"seq": sequence, **header}}
        self._writer.write(found, at_ns, types_of(1).encode(kind, fields))

    def finish(self) -> None:
        """Write the index."""
        self._writer.close()

    def discard(self) -> None:
        """Delete the unfinished file."""
        with suppress(OSError):
            self._writer.abort()
        super().discard()

    def _connection(self, topic: str, kind: str) -> Connection:
        text, md5 = types_of(1).definition(kind)
        name = short_kind(kind).replace("/", "/msg/", 1)
        found = self._writer.add_connection(topic, name, msgdef=text, md5sum=md5, callerid=_CALLER, latching=0)
        self._connections[topic, kind] = found
        return found


class _OpenFile(NamedTuple):
    """A path of an open file. When the library opens the path, it gets a duplicate of the open file."""

    stream: BinaryIO

    def open(self, _mode: str) -> BinaryIO:
        """Return a duplicate of the file, which the library closes."""
        return os.fdopen(os.dup(self.stream.fileno()), "wb")


class _Record(NamedTuple):
    """The fields of a record's header, and the range of its data in a chunk."""

    header: dict[bytes, bytes]
    begin: int
    end: int

    @property
    def kind(self) -> int:
        """The operation code; 0 if it is missing."""
        return self.number(b"op") if b"op" in self.header else 0

    def number(self, name: bytes) -> int:
        """Return the number in the field `name`; times are in nanoseconds."""
        content = self.header.get(name, b"")
        layout = _LAYOUTS[name]
        if len(content) != struct.calcsize(layout):
            raise RecordingDamagedError(f"a record has no valid {name.decode()!r} in its header")
        first, *more = struct.unpack(layout, content)
        return int(first) * 10**9 + int(more[0]) if more else int(first)

    def text(self, name: bytes) -> str:
        """Return the text in the field `name`; empty if the field is missing."""
        return self.header.get(name, b"").decode("utf-8", "replace")


def _decompress_bz2(packed: bytes, most: int) -> bytes:
    return bz2.BZ2Decompressor().decompress(packed, max_length=most)


class RosbagSource(ChunkedRecordingSource):
    """Reads a ROS 1 bag."""

    packings = MappingProxyType({"none": uncompressed, "bz2": _decompress_bz2, "lz4": decompress_lz4})

    def _blocks(self) -> Iterator[MessageBlock]:
        self._channels: dict[int, RecordedChannel | None] = {}
        source = self._input
        magic = source.read(min(source.size, len(_MAGIC)), "its beginning")
        if magic != _MAGIC:
            is_bag = magic.startswith(b"#ROSBAG V")
            raise RecordingDamagedError("is a bag of another version than 2.0" if is_bag else "is not a ROS 1 bag")
        expected = self._first()
        found = {_CHUNK: 0, _CHUNK_INFO: 0, _CONNECTION: 0}
        while source.at < source.size:
            record, size = self._header()
            kind = record.kind
            found[kind] = found.get(kind, 0) + 1
            if kind == _CHUNK:
                yield from self._chunk(record, size)
            else:
                source.skip(size, "a record")
        if any(found[kind] != number for kind, number in expected.items()):
            raise RecordingDamagedError("its index is incomplete: the recording is incomplete")

    def _first(self) -> dict[int, int]:
        """Read the bag header; return the declared numbers of chunks, chunk infos and connections."""
        record, size = self._header()
        if record.kind != _BAG:
            raise RecordingDamagedError("it does not begin with the header of a bag")
        self._input.skip(size, "its beginning")
        if not record.number(b"index_pos"):
            raise RecordingDamagedError(
                "it has no index: the recording was not finished; repair it by `rosbag reindex`"
            )
        if record.text(b"encryptor"):
            raise RecordingDamagedError("it is encrypted")
        chunks = record.number(b"chunk_count")
        return {_CHUNK: chunks, _CHUNK_INFO: chunks, _CONNECTION: record.number(b"conn_count")}

    def _header(self) -> tuple[_Record, int]:
        """Read the next record's header; return the header and the size of the following data."""
        source = self._input
        size = self._size()
        if size > _HEADER_AT_MOST:
            raise RecordingDamagedError(f"a record before byte {source.at} has a header of {size} bytes")
        header = _fields(source.read(size, "a record"))
        return _Record(header, 0, 0), self._size()

    def _size(self) -> int:
        (size,) = _SIZE.unpack(self._input.read(_SIZE.size, "a record"))
        return int(size)

    def _chunk(self, record: _Record, size: int) -> Iterator[MessageBlock]:
        packing, full_size, at = record.text(b"compression"), record.number(b"size"), self._input.at
        body = self._body(self._input.read(size, "a chunk"), packing, full_size)
        starts = min((time for _, time, _ in self._messages(body)), default=None)
        if starts is not None:
            yield MessageBlock(starts, at, size, packing, full_size)

    def _messages(self, body: bytes) -> Iterator[tuple[RecordedChannel, int, bytes]]:
        for record in _records(body):
            kind = record.kind
            if kind == _CONNECTION:
                number, described = record.number(b"conn"), self._channel_of(record, body)
                if self._channels.setdefault(number, described) != described:
                    raise RecordingDamagedError(f"connection {number} has two different definitions")
            elif kind == _MESSAGE:
                number = record.number(b"conn")
                if number not in self._channels:
                    raise RecordingDamagedError(
                        f"a message has the connection {number}, which is not defined before it"
                    )
                channel = self._channels[number]
                if channel is not None:
                    if channel.fault:
                        raise RecordingDamagedError(f"the message on {channel.topic} cannot be read: {channel.fault}")
                    yield channel, record.number(b"time"), body[record.begin : record.end]

    def _channel_of(self, record: _Record, body: bytes) -> RecordedChannel | None:
        topic = "/" + record.text(b"topic").lstrip("/")
        more = _Record(_fields(body[record.begin : record.end]), 0, 0)
        kind, md5 = more.text(b"type"), more.text(b"md5sum")
        if not self._is_used(topic, kind):
            return None
        ours = types_of(1).definition(kind).md5
        fault = f"its {short_kind(kind)} has the MD5 sum {md5[:40]!r}, not {ours} as in ROS 1" if md5 != ours else ""
        return RecordedChannel(topic, 1, fault)


def _records(body: bytes) -> Iterator[_Record]:
    """Yield the records of a chunk."""
    at = 0
    while at < len(body):
        begin, end = _span(body, at)
        header = _fields(body[begin:end])
        begin, at = _span(body, end)
        yield _Record(header, begin, at)


def _span(body: bytes, at: int) -> tuple[int, int]:
    """Return the start and the end of the content at `at`, which is preceded by its size."""
    begin = at + _SIZE.size
    end = begin + int.from_bytes(body[at:begin], "little")
    if end > len(body) or begin > len(body):
        raise RecordingDamagedError("a record is longer than its chunk")
    return begin, end


def _fields(content: bytes) -> dict[bytes, bytes]:
    """Parse the fields of a header, each of which is a size and `name=value`."""
    found, at = {}, 0
    while at < len(content):
        begin, at = _span(content, at)
        name, equals, value = content[begin:at].partition(b"=")
        if not equals:
            raise RecordingDamagedError("a record's header has a field without a value")
        found[name] = value
    return found
