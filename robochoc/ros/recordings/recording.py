"""The base classes of recordings (MCAP files, ROS 1 bags, ROS 2 bags) as sources and sinks.

Recordings are untrusted. A recording is read twice: first completely, so that messages in a damaged file have no
effect; then block by block, in chronological order. Sizes are checked before memory is allocated or data decompressed.
"""

from __future__ import annotations

import heapq
import os
import stat
import zlib
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, ClassVar, NamedTuple

import lz4.frame  # type: ignore[import-untyped]

from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.sink import Fields, Sink, SinkError
from robochoc.robots.source import ReceivedMessage, Source, SourceError
from robochoc.ros.message_types import FieldsError, UnknownTypeError, Version, types_of
from robochoc.ros.waypoint_types import short_kind
from robochoc.system.errors import RobochocError
from robochoc.system.files import PendingFile

_END_OF_TIME = (1 << 32) * 10**9
"""The first time after the range of ROS 1, in nanoseconds since the epoch."""
BLOCK_BYTES_MAX = 1 << 26
"""The largest record or decompressed chunk, in bytes. Recorders write chunks of some megabytes."""
WAITING_BYTES_MAX = 1 << 28
"""The maximum size of messages waiting to be sorted by time, in bytes. Many wait only if blocks overlap in time."""
UNPACKED_BYTES_MAX = 1 << 28
"""The maximum decompressed size of a file, in bytes; or `_RATIO` times its compressed size, if that is larger."""
_RATIO = 100
_MESSAGE_OVERHEAD = 200
"""The approximate memory of a message besides its content, in bytes."""
_STEP = 1 << 20
_OTHERS_MAX = 1_000
"""The maximum number of unused topics whose names are stored."""


Unpack = Callable[[bytes, int], bytes]
"""Decompresses its input, up to the given number of bytes. May raise any exception."""


class RecordingDamagedError(RobochocError):
    """The recording is damaged. The message describes the damage."""


class RecordedChannel(NamedTuple):
    """A used topic in a recording. `fault` is the reason if its messages cannot be read."""

    topic: str
    version: Version
    fault: str = ""


class MessageBlock(NamedTuple):
    """A part of a file that contains messages: time of the first used message, offset, sizes and compression."""

    starts: int
    at: int
    size: int
    packing: str
    decompressed_size: int


class RecordedMessage(NamedTuple):
    """A message with its sort key (time, block, number)."""

    at_ns: int
    block: int
    number: int
    channel: RecordedChannel
    content: bytes


class InputFile:
    """A file that is read sequentially. Raises `RecordingDamagedError` and `OSError`."""

    def __init__(self, path: Path) -> None:
        if not stat.S_ISREG(path.stat().st_mode):
            raise RecordingDamagedError("is a folder" if path.is_dir() else "is not a file")
        self._stream: BinaryIO = path.open("rb")
        self.size = os.fstat(self._stream.fileno()).st_size
        self.at = 0
        self.sum = 0
        """CRC-32 of all bytes read so far."""

    def rewind(self) -> None:
        """Return to the beginning."""
        self.at = self.sum = self._stream.seek(0)

    def read(self, size: int, what: str) -> bytes:
        """Read the next `size` bytes. `what` describes these bytes in errors."""
        self._check(size, what)
        if size > BLOCK_BYTES_MAX:
            raise RecordingDamagedError(
                f"{what} has {size:,} bytes, at byte {self.at:,}: at most {BLOCK_BYTES_MAX:,} are read"
            )
        content = self._stream.read(size)
        self.at += len(content)
        self.sum = zlib.crc32(content, self.sum)
        return content

    def skip(self, size: int, what: str) -> None:
        """Skip the next `size` bytes."""
        self._check(size, what)
        for begin in range(0, size, _STEP):
            self.read(min(_STEP, size - begin), what)

    def part(self, at: int, size: int) -> bytes:
        """Return a part of the file, without changing the position for `read`."""
        self._stream.seek(at)
        content = self._stream.read(size)
        self._stream.seek(self.at)
        return content

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def _check(self, size: int, what: str) -> None:
        if size > self.size - self.at:
            raise RecordingDamagedError(f"it ends within {what}, at byte {self.size:,}: the recording is incomplete")


class RecordingSource(Source):
    """Reads a file, and returns its messages in the order in which they were received."""

    live = False

    def __init__(self, place: str) -> None:
        super().__init__(place)
        if not place:
            raise SourceError(
                "a recording requires a file name, as in mcap:run.mcap, rosbag:run.bag or rosbag2:run.db3"
            )
        with self._as_source_errors():
            self._input = InputFile(Path(place))
        self._kinds: Mapping[str, str] = {}
        self._messages_left: Iterator[RecordedMessage] = iter(())

    def listen(self, topics: Mapping[str, str]) -> None:
        """Read the whole file once. `next` then returns the messages on these topics, from the beginning."""
        self._kinds = topics
        with self._as_source_errors():
            self._messages_left = self._read_messages()

    @abstractmethod
    def _read_messages(self) -> Iterator[RecordedMessage]:
        """Read the whole file, then return the used messages in order. Raises `RecordingDamagedError`."""

    def next(self, wait_s: float) -> ReceivedMessage | None:  # noqa: ARG002 - a recording has no waits
        """Return the next message; None at the end."""
        with self._as_source_errors():
            message = next(self._messages_left, None)
            if message is None:
                return None
            channel = message.channel
            kind = self._kinds[channel.topic]
            try:
                fields = types_of(channel.version).decode(kind, message.content)
            except FieldsError as error:
                raise RecordingDamagedError(f"a message on {channel.topic} cannot be read: {error}") from error
            return ReceivedMessage(channel.topic, kind, fields, message.at_ns)

    def close(self) -> None:
        """Close the file."""
        self._messages_left = iter(())
        self._input.close()

    def _is_used(self, topic: str, kind: str) -> bool:
        """Return whether messages of this type on this topic are used; list others in `others`."""
        is_used = topic in self._kinds and short_kind(self._kinds[topic]) == short_kind(kind)
        if not is_used and len(self.others) < _OTHERS_MAX:
            self.others[topic] = kind
        return is_used

    @contextmanager
    def _as_source_errors(self) -> Iterator[None]:
        """Raise errors of the file as `SourceError` with the file's name."""
        try:
            yield
        except (RecordingDamagedError, UnknownTypeError) as error:
            raise SourceError(on_one_line(f"{self.place}: {error}")) from error
        except OSError as error:
            raise SourceError(on_one_line(f"{self.place}: {error.strerror or error}")) from error


class ChunkedRecordingSource(RecordingSource):
    """Reads a recording whose messages are stored in chunks, usually compressed."""

    packings: ClassVar[Mapping[str, Unpack]]
    """The functions that decompress chunks, by the name of the compression in the format."""

    _decompressed_bytes = 0

    def _read_messages(self) -> Iterator[RecordedMessage]:
        self._decompressed_bytes = 0
        self._input.rewind()
        return self._in_order(sorted(self._blocks()))

    @abstractmethod
    def _blocks(self) -> Iterable[MessageBlock]:
        """Read the whole file, and return the blocks with used messages. Raises `RecordingDamagedError`."""

    @abstractmethod
    def _messages(self, body: bytes) -> Iterator[tuple[RecordedChannel, int, bytes]]:
        """Yield the used messages of a block: channel, time in nanoseconds, and content.

        Raises:
            RecordingDamagedError: The block is damaged.
        """

    def _body(self, packed: bytes, packing: str, size: int) -> bytes:
        """Return the content of a chunk, which must have `size` bytes."""
        self._decompressed_bytes += size
        if self._decompressed_bytes > max(UNPACKED_BYTES_MAX, _RATIO * self._input.size):
            raise RecordingDamagedError(
                f"its {self._input.size:,} bytes decompress to at least {self._decompressed_bytes:,}: that is too much"
            )
        return decompress(packed, packing, size, self.packings)

    def _in_order(self, blocks: Iterable[MessageBlock]) -> Iterator[RecordedMessage]:
        """Yield all messages of `blocks` in order. Blocks are sorted by their first messages."""
        waiting: list[RecordedMessage] = []
        size = 0
        for number, block in enumerate(blocks):
            while waiting and waiting[0].at_ns < block.starts:
                message = heapq.heappop(waiting)
                size -= _MESSAGE_OVERHEAD + len(message.content)
                yield message
            body = decompress(
                self._input.part(block.at, block.size), block.packing, block.decompressed_size, self.packings
            )
            for place, (channel, at_ns, content) in enumerate(self._messages(body)):
                heapq.heappush(waiting, RecordedMessage(at_ns, block.at, place, channel, content))
                size += _MESSAGE_OVERHEAD + len(content)
                if size > WAITING_BYTES_MAX:
                    raise RecordingDamagedError(
                        f"its messages are out of order: at chunk {number:,}, too many have to be sorted"
                    )
        while waiting:
            yield heapq.heappop(waiting)


def decompress(packed: bytes, packing: str, size: int, packings: Mapping[str, Unpack]) -> bytes:
    """Return the `size` decompressed bytes of `packed`. At most one more byte is decompressed.

    Raises:
        RecordingDamagedError: The decompressed size is not `size`, or the bytes are not compressed by `packing`.
    """
    if size > BLOCK_BYTES_MAX:
        raise RecordingDamagedError(f"a chunk decompresses to {size:,} bytes: at most {BLOCK_BYTES_MAX:,} are read")
    if packing not in packings:
        raise RecordingDamagedError(
            f"a chunk has an unknown compression, {packing[:40]!r}; supported: {', '.join(filter(None, packings))}"
        )
    try:
        body = packings[packing](packed, size + 1)
    except Exception as error:  # libraries raise RuntimeError, OSError and their own errors
        raise RecordingDamagedError(f"a chunk cannot be decompressed ({packing}): {error}") from error
    if len(body) != size:
        raise RecordingDamagedError(f"a chunk does not decompress to the declared {size:,} bytes")
    return body


def uncompressed(packed: bytes, _most: int) -> bytes:
    """Return the unchanged bytes of an uncompressed chunk."""
    return packed


def decompress_lz4(packed: bytes, most: int) -> bytes:
    """Return up to `most` bytes of an LZ4 frame."""
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=most))


def recording_in_folder(place: str, name: str, ending: str, instead: str) -> str:
    """Return the recording in the folder `place`, or `place` itself if it is not a folder.

    Args:
        place: The part of the source's command-line argument after its name.
        name: The name of the source on the command line.
        ending: The file name extension of its files.
        instead: A hint for folders without such a file.

    Raises:
        SourceError: The folder has no such file, or several.
    """
    if not place or not Path(place).is_dir():
        return place
    files = sorted(Path(place).glob(f"*{ending}"))
    if not files:
        raise SourceError(on_one_line(f"{place}: is a folder without a file *{ending}: {instead}"))
    if len(files) > 1:
        raise SourceError(on_one_line(f"{place}: has several recordings: name one, such as {name}:{files[0]}"))
    return str(files[0])


class RecordingSink(Sink):
    """Writes a file. The complete file appears when the sink is closed; after an error, no file appears."""

    example: ClassVar[str]
    """An example of such a sink on the command line."""
    version: ClassVar[Version]

    live = False

    def __init__(self, place: str) -> None:
        super().__init__(place)
        if not place:
            raise SinkError(f"a recording requires a file name, as in {self.example}")
        self.original: Mapping[str, str] = MappingProxyType({})
        self._open = False
        with self.as_sink_errors():
            self.file = PendingFile(Path(place))
        self._open = True

    @abstractmethod
    def write(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Append a message. Raises `FieldsError`, `UnknownTypeError` and `OSError`."""

    @abstractmethod
    def finish(self) -> None:
        """Write the end of the file. Raises `OSError`."""

    def explain(self, original: Mapping[str, str]) -> None:
        """Store the original names of the topics, from the team's files."""
        self.original = original

    def advertise(self, topics: Mapping[str, str]) -> None:
        """Check that the types of `topics` are known."""
        for topic, kind in topics.items():
            with self.as_sink_errors(topic):
                types_of(self.version).definition(kind)

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Append a message, with `at_ns` as the time of its publication and reception."""
        if not 0 <= at_ns < _END_OF_TIME:
            raise SinkError(on_one_line(f"{self.place}: {topic}: the time {at_ns} ns cannot be recorded"))
        with self.as_sink_errors(topic):
            self.write(topic, kind, fields, at_ns)

    def close(self) -> None:
        """Complete the file; delete it if that fails."""
        if self._open:
            self._open = False
            try:
                with self.as_sink_errors():
                    self.finish()
                    self.file.keep()
            finally:
                self.discard()

    def discard(self) -> None:
        """Delete the unfinished file."""
        self._open = False
        self.file.discard()

    @contextmanager
    def as_sink_errors(self, topic: str = "") -> Iterator[None]:
        """Raise errors as `SinkError` with the names of the file and the topic."""
        where = f"{self.place}: {topic}" if topic else self.place
        try:
            yield
        except (FieldsError, UnknownTypeError) as error:
            raise SinkError(on_one_line(f"{where}: {error}")) from error
        except OSError as error:
            why = error.strerror or str(error)
            missing = isinstance(error, FileNotFoundError) and not Path(self.place).absolute().parent.exists()
            hint = ": its folder does not exist, create it first" if missing else ""
            raise SinkError(on_one_line(f"{self.place}: {why}{hint}")) from error
