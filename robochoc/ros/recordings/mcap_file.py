"""MCAP files: the container format of ROS 2's recorder, which Foxglove opens (mcap.dev/spec).

Files are written with the profile `ros2`: messages in CDR with their definitions, in chunks compressed by zstd. Files
with the profile `ros1` can also be read.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from io import BytesIO
from types import MappingProxyType
from typing import NamedTuple, TypeVar

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.message_types import Version, types_of
from robochoc.ros.recordings.recording import (
    BLOCK_BYTES_MAX,
    ChunkedRecordingSource,
    MessageBlock,
    RecordedChannel,
    RecordingDamagedError,
    RecordingSink,
    decompress_lz4,
    recording_in_folder,
    uncompressed,
)
from robochoc.ros.waypoint_types import short_kind

NAMES = "robochoc:names"
"""The metadata record with the original names of the topics, from the team's files."""

_CHUNK_BYTES = 1 << 20
_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQII")
_SIZE = struct.Struct("<Q")
_FOOTER_SIZE = 20
_CHANNELS_AT_MOST = 0xFFFF
_DEFINITIONS_MAX = 64
"""The maximum number of definitions of the used types. A normal recording defines each type once."""
_ENCODINGS: dict[tuple[str, str], Version] = {("ros2msg", "cdr"): 2, ("ros1msg", "ros1"): 1}
"""The encodings of definitions and messages."""


T = TypeVar("T")


class McapSink(RecordingSink):
    """Writes an MCAP file. The same messages always give the same bytes."""

    example = "mcap:run.mcap"
    version = 2

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str], int] = {}
        self._sequence: dict[int, int] = {}
        with self.as_sink_errors():
            self._writer = Writer(self.file.stream, _CHUNK_BYTES, CompressionType.ZSTD, enable_data_crcs=True)
            self._writer.start("ros2")

    def explain(self, original: Mapping[str, str]) -> None:
        """Store the original names in the metadata of the file and of each topic."""
        super().explain(original)
        with self.as_sink_errors():
            self._writer.add_metadata(NAMES, dict(original))

    def write(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Append a message."""
        content = types_of(2).encode(kind, fields)
        channel = self._channels.get((topic, kind)) or self._channel(topic, kind)
        self._sequence[channel] = sequence = self._sequence.get(channel, 0) + 1
        self._writer.add_message(channel, at_ns, content, at_ns, sequence)

    def finish(self) -> None:
        """Write the index."""
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _channel(self, topic: str, kind: str) -> int:
        if len(self._channels) == _CHANNELS_AT_MOST:
            raise SinkError(f"{self.place}: an MCAP file has at most {_CHANNELS_AT_MOST} topics")
        short = short_kind(kind)
        if short not in self._schemas:
            text = types_of(2).definition(short).text
            name = short.replace("/", "/msg/", 1)
            self._schemas[short] = self._writer.register_schema(name, "ros2msg", text.encode())
        metadata = {"original": self.original[topic]} if topic in self.original else {}
        found = self._writer.register_channel(topic, "cdr", self._schemas[short], metadata)
        self._channels[topic, kind] = found
        return found


class _WantedSchema(NamedTuple):
    """A schema of a used type, its encoding, and the reason if its messages cannot be read."""

    kind: str
    encoding: str
    fault: str


def _decompress_zstd(packed: bytes, most: int) -> bytes:
    """Decompress as a stream: the size declared in a frame is untrusted."""
    return zstandard.ZstdDecompressor(max_window_size=BLOCK_BYTES_MAX).stream_reader(packed).read(most)


class McapSource(ChunkedRecordingSource):
    """Reads an MCAP file from ROS 2 or ROS 1, or the MCAP file in a folder recorded by ROS 2."""

    packings = MappingProxyType({"": uncompressed, "lz4": decompress_lz4, "zstd": _decompress_zstd})

    def __init__(self, place: str) -> None:
        super().__init__(recording_in_folder(place, "mcap", ".mcap", "rosbag2:FOLDER reads the .db3 of ROS 2"))

    def _blocks(self) -> Iterator[MessageBlock]:
        self._schemas: dict[int, _WantedSchema | None] = {}
        self._channels: dict[int, RecordedChannel | None] = {}
        self._faults: dict[tuple[str, str, bytes], str] = {}
        source = self._input
        if source.size < len(MCAP0_MAGIC) or source.read(len(MCAP0_MAGIC), "its beginning") != MCAP0_MAGIC:
            raise RecordingDamagedError("is not an MCAP file")
        opcode = 0
        while opcode != Opcode.DATA_END:
            begin, before = source.at, source.sum
            opcode, size = _RECORD.unpack(source.read(_RECORD.size, "a record"))
            match opcode:
                case Opcode.CHUNK:
                    yield from self._chunk(begin, source.read(size, "a chunk"))
                case Opcode.SCHEMA | Opcode.CHANNEL | Opcode.MESSAGE:
                    body = _RECORD.pack(opcode, size) + source.read(size, "a record")
                    yield from self._block(body, begin, len(body), "")
                case Opcode.DATA_END:
                    (expected,) = _read("<I", source.read(size, "a record"))
                    if expected not in {0, before}:
                        raise RecordingDamagedError("it is damaged: wrong checksum")
                case _:
                    source.skip(size, "a record")
        self._check_end()

    def _check_end(self) -> None:
        """Check that the file ends with a footer and the magic bytes."""
        size = _RECORD.size + _FOOTER_SIZE + len(MCAP0_MAGIC)
        tail = self._input.part(max(0, self._input.size - size), size)
        if not tail.startswith(_RECORD.pack(Opcode.FOOTER, _FOOTER_SIZE)) or not tail.endswith(MCAP0_MAGIC):
            raise RecordingDamagedError("it has no footer: the recording is incomplete")

    def _chunk(self, begin: int, content: bytes) -> Iterator[MessageBlock]:
        _, _, size, expected, length = _read(_CHUNK.format, content)
        place = _CHUNK.size + length + _SIZE.size
        packing = content[_CHUNK.size : _CHUNK.size + length].decode("ascii", "replace")
        (packed,) = _read(_SIZE.format, content[_CHUNK.size + length :])
        if place + packed != len(content):
            raise RecordingDamagedError(f"the chunk at byte {begin} does not have the declared size")
        body = self._body(content[place:], packing, size)
        if expected and zlib.crc32(body) != expected:
            raise RecordingDamagedError(f"the chunk at byte {begin} is damaged: wrong checksum")
        yield from self._block(body, begin + _RECORD.size + place, packed, packing)

    def _block(self, body: bytes, at: int, size: int, packing: str) -> Iterator[MessageBlock]:
        starts = min((time for _, time, _ in self._messages(body)), default=None)
        if starts is not None:
            yield MessageBlock(starts, at, size, packing, len(body))

    def _messages(self, body: bytes) -> Iterator[tuple[RecordedChannel, int, bytes]]:
        at = 0
        while at < len(body):
            opcode, size = _read(_RECORD.format, body[at : at + _RECORD.size])
            at += _RECORD.size
            if size > len(body) - at:
                raise RecordingDamagedError("a record is longer than its chunk")
            if opcode == Opcode.MESSAGE:
                number, _, time, _ = _read(_MESSAGE.format, body[at : at + min(size, _MESSAGE.size)])
                channel = self._channels.get(number)
                if channel is not None:
                    if channel.fault:
                        raise RecordingDamagedError(f"the message on {channel.topic} cannot be read: {channel.fault}")
                    yield channel, time, body[at + _MESSAGE.size : at + size]
                elif number not in self._channels:
                    raise RecordingDamagedError(f"a message has the channel {number}, which is not defined before it")
            elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
                self._describe(opcode, body[at : at + size])
            at += size

    def _describe(self, opcode: int, content: bytes) -> None:
        """Store the required data of a schema or channel record."""
        stream = ReadDataStream(BytesIO(content))
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                _define(self._schemas, schema.id, self._wanted_schema(schema))
            else:
                channel = ChannelRecord.read(stream)
                _define(self._channels, channel.id, self._channel_of(channel))
        except (McapError, struct.error, ValueError) as error:
            what = "schema" if opcode == Opcode.SCHEMA else "channel"
            raise RecordingDamagedError(f"a {what} cannot be read: {type(error).__name__} {error}") from error

    def _wanted_schema(self, schema: Schema) -> _WantedSchema | None:
        kind = short_kind(schema.name)
        if kind not in map(short_kind, self._kinds.values()):
            return None
        defined = kind, schema.encoding, schema.data
        if defined not in self._faults:
            if len(self._faults) == _DEFINITIONS_MAX:
                raise RecordingDamagedError(f"it has more than {_DEFINITIONS_MAX} definitions of its message types")
            self._faults[defined] = _fault(*defined)
        return _WantedSchema(kind, schema.encoding, self._faults[defined])

    def _channel_of(self, channel: ChannelRecord) -> RecordedChannel | None:
        schema = self._schemas.get(channel.schema_id)
        if schema is None or not self._is_used(channel.topic, schema.kind):
            return None
        version = _ENCODINGS.get((schema.encoding, channel.message_encoding))
        if version is None and not schema.fault:
            fault = f"its messages have the encoding {channel.message_encoding[:40]!r}"
            return RecordedChannel(channel.topic, 2, fault)
        return RecordedChannel(channel.topic, version or 2, schema.fault)


def _fault(kind: str, encoding: str, text: bytes) -> str:
    """Return the reason why messages with a definition cannot be read; empty if they can be read."""
    versions = [version for (known, _), version in _ENCODINGS.items() if known == encoding]
    if not versions:
        return f"its definition has the encoding {encoding[:40]!r}: only ros2msg and ros1msg can be read"
    if not types_of(versions[0]).has_same_fields(kind, text.decode("utf-8", "replace")):
        return f"its definition of {kind} differs from that of ROS {versions[0]}"
    return ""


def _define(table: dict[int, T], number: int, described: T) -> None:
    if table.setdefault(number, described) != described:
        raise RecordingDamagedError(f"schema or channel {number} has two different definitions")


def _read(layout: str, content: bytes) -> tuple[int, ...]:
    """Return the numbers at the beginning of `content`."""
    try:
        return struct.unpack_from(layout, content)
    except struct.error:
        raise RecordingDamagedError("a record is too short for its kind") from None
