"""Recordings as sources: what MCAP files, bags of ROS 1 and bags of ROS 2 have in common when they are read.

A recording may come from anywhere. It is read twice: first completely, so that nothing is acted upon that comes from a
damaged file; then block by block, in the order of time. Sizes are checked before anything is allocated or decompressed.
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
"""The first time, in nanoseconds since the epoch, that ROS 1 cannot hold."""
BLOCK_BYTES_MAX = 1 << 26
"""Bytes of a record, and of a decompressed chunk. Recorders make chunks of some megabytes."""
WAITING_BYTES_MAX = 1 << 28
"""Bytes of messages that wait for their turn. There are many only where blocks overlap in time."""
UNPACKED_BYTES_MAX = 1 << 28
"""Bytes of a whole decompressed file, if that is more than `_RATIO` times its size."""
_RATIO = 100
_ENTRY = 200
"""About the memory of a message, besides its bytes."""
_STEP = 1 << 20
_OTHERS_MAX = 1_000
"""Topics that are not wanted, and whose names are kept."""


Unpack = Callable[[bytes, int], bytes]
"""Decompresses its input, up to a number of bytes. May raise anything."""


class RecordingDamagedError(RobochocError):
    """The recording is damaged. The message says what is wrong."""


class RecordedChannel(NamedTuple):
    """A topic that is wanted, as a recording has it. `fault` says why its messages cannot be read."""

    topic: str
    version: Version
    fault: str = ""


class MessageBlock(NamedTuple):
    """A part of a file that holds messages: its offset, its compression, and the time of the first wanted message."""

    starts: int
    at: int
    size: int
    packing: str
    unpacked: int


class RecordedMessage(NamedTuple):
    """A message, with what defines its order."""

    at_ns: int
    block: int
    number: int
    channel: RecordedChannel
    content: bytes


class InputFile:
    """A file that is read from its beginning to its end. Raises `RecordingDamagedError` and `OSError`."""

    def __init__(self, path: Path) -> None:
        if not stat.S_ISREG(path.stat().st_mode):
            raise RecordingDamagedError("is a folder" if path.is_dir() else "is no file")
        self._stream: BinaryIO = path.open("rb")
        self.size = os.fstat(self._stream.fileno()).st_size
        self.at = 0
        self.sum = 0
        """CRC-32 of all that has been read."""

    def rewind(self) -> None:
        """Begin again."""
        self.at = self.sum = self._stream.seek(0)

    def take(self, size: int, what: str) -> bytes:
        """Return the next `size` bytes."""
        self._check(size, what)
        if size > BLOCK_BYTES_MAX:
            raise RecordingDamagedError(
                f"{what} of {size} bytes before byte {self.at}: more than {BLOCK_BYTES_MAX} are not read"
            )
        content = self._stream.read(size)
        self.at += len(content)
        self.sum = zlib.crc32(content, self.sum)
        return content

    def skip(self, size: int, what: str) -> None:
        """Skip the next `size` bytes."""
        self._check(size, what)
        for begin in range(0, size, _STEP):
            self.take(min(_STEP, size - begin), what)

    def part(self, at: int, size: int) -> bytes:
        """Return a part of the file somewhere else. The position of `take` does not change."""
        self._stream.seek(at)
        content = self._stream.read(size)
        self._stream.seek(self.at)
        return content

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def _check(self, size: int, what: str) -> None:
        if size > self.size - self.at:
            raise RecordingDamagedError(
                f"it ends in the middle of {what}, at byte {self.size}: it was not written to its end"
            )


class RecordingSource(Source):
    """A file that gives its messages in the order of the times at which they were received."""

    live = False

    def __init__(self, place: str) -> None:
        super().__init__(place)
        if not place:
            raise SourceError(
                "a recording needs the name of its file, as in mcap:run.mcap, rosbag:run.bag or rosbag2:run.db3"
            )
        with self._as_source_errors():
            self._input = InputFile(Path(place))
        self._kinds: Mapping[str, str] = {}
        self._messages_left: Iterator[RecordedMessage] = iter(())

    def listen(self, topics: Mapping[str, str]) -> None:
        """Read all of the file once. `next` then returns the messages on these topics, from the beginning."""
        self._kinds = topics
        with self._as_source_errors():
            self._messages_left = self._read_messages()

    @abstractmethod
    def _read_messages(self) -> Iterator[RecordedMessage]:
        """Read all of the file, then return the wanted messages, in order. Raises `RecordingDamagedError`."""

    def next(self, wait_s: float) -> ReceivedMessage | None:  # noqa: ARG002 - all has been recorded
        """Return the next message; None at the end."""
        with self._as_source_errors():
            entry = next(self._messages_left, None)
            if entry is None:
                return None
            channel = entry.channel
            kind = self._kinds[channel.topic]
            try:
                fields = types_of(channel.version).decode(kind, entry.content)
            except FieldsError as error:
                raise RecordingDamagedError(f"a message on {channel.topic} cannot be read: {error}") from error
            return ReceivedMessage(channel.topic, kind, fields, entry.at_ns)

    def close(self) -> None:
        """Close the file."""
        self._messages_left = iter(())
        self._input.close()

    def _wanted(self, topic: str, kind: str) -> bool:
        """Return whether messages of that type on that topic are wanted."""
        wanted = topic in self._kinds and short_kind(self._kinds[topic]) == short_kind(kind)
        if not wanted and len(self.others) < _OTHERS_MAX:
            self.others[topic] = kind
        return wanted

    @contextmanager
    def _as_source_errors(self) -> Iterator[None]:
        """Raise errors of the file as `SourceError`, with its name."""
        try:
            yield
        except (RecordingDamagedError, UnknownTypeError) as error:
            raise SourceError(on_one_line(f"{self.place}: {error}")) from error
        except OSError as error:
            raise SourceError(on_one_line(f"{self.place}: {error.strerror or error}")) from error


class ChunkedRecordingSource(RecordingSource):
    """A recording whose messages stand in chunks, most of them compressed."""

    packings: ClassVar[Mapping[str, Unpack]]
    """The functions that decompress chunks, by the format's names of compressions."""

    _unpacked = 0

    def _read_messages(self) -> Iterator[RecordedMessage]:
        self._unpacked = 0
        self._input.rewind()
        return self._in_order(sorted(self._blocks()))

    @abstractmethod
    def _blocks(self) -> Iterable[MessageBlock]:
        """Read all of the file, and return the blocks with wanted messages. Raises `RecordingDamagedError`."""

    @abstractmethod
    def _messages(self, body: bytes) -> Iterator[tuple[RecordedChannel, int, bytes]]:
        """Yield the wanted messages of a block: channel, time in nanoseconds, and content.

        Raises:
            RecordingDamagedError: The block is damaged.
        """

    def _body(self, packed: bytes, packing: str, size: int) -> bytes:
        """Return the content of a chunk, which should be `size` bytes."""
        self._unpacked += size
        if self._unpacked > max(UNPACKED_BYTES_MAX, _RATIO * self._input.size):
            raise RecordingDamagedError(
                f"its {self._input.size} bytes unpack to {self._unpacked} and more, which are not read"
            )
        return decompress(packed, packing, size, self.packings)

    def _in_order(self, blocks: Iterable[MessageBlock]) -> Iterator[RecordedMessage]:
        """Yield all messages of `blocks`, which come in the order of their first ones."""
        waiting: list[RecordedMessage] = []
        size = 0
        for number, block in enumerate(blocks):
            while waiting and waiting[0].at_ns < block.starts:
                entry = heapq.heappop(waiting)
                size -= _ENTRY + len(entry.content)
                yield entry
            body = decompress(self._input.part(block.at, block.size), block.packing, block.unpacked, self.packings)
            for place, (channel, at_ns, content) in enumerate(self._messages(body)):
                heapq.heappush(waiting, RecordedMessage(at_ns, block.at, place, channel, content))
                size += _ENTRY + len(content)
                if size > WAITING_BYTES_MAX:
                    raise RecordingDamagedError(
                        f"its messages are out of order: at chunk {number}, too many wait for their turn"
                    )
        while waiting:
            yield heapq.heappop(waiting)


def decompress(packed: bytes, packing: str, size: int, packings: Mapping[str, Unpack]) -> bytes:
    """Return the `size` bytes of `packed`. No more than one byte more is decompressed.

    Raises:
        RecordingDamagedError: There are more bytes, or fewer, or they are no `packing`.
    """
    if size > BLOCK_BYTES_MAX:
        raise RecordingDamagedError(
            f"a chunk says that it unpacks to {size} bytes; more than {BLOCK_BYTES_MAX} are not read"
        )
    if packing not in packings:
        raise RecordingDamagedError(
            f"a chunk is packed by {packing[:40]!r}; known are {', '.join(filter(None, packings))}"
        )
    try:
        body = packings[packing](packed, size + 1)
    except Exception as error:  # whatever the library raises: RuntimeError, OSError, its own
        raise RecordingDamagedError(f"a chunk cannot be unpacked ({packing}): {error}") from error
    if len(body) != size:
        raise RecordingDamagedError(f"a chunk does not unpack to the {size} bytes that it says")
    return body


def uncompressed(packed: bytes, _most: int) -> bytes:
    """Return the bytes of a chunk that is not compressed."""
    return packed


def decompress_lz4(packed: bytes, most: int) -> bytes:
    """Return up to `most` bytes of an LZ4 frame."""
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=most))


def recording_in_folder(place: str, name: str, ending: str, instead: str) -> str:
    """Return the recording in the folder `place`, or `place` itself where it is no folder.

    Args:
        place: What follows the name on the command line.
        name: The source's name on the command line.
        ending: How the names of its files end.
        instead: What to do where the folder has no such file.

    Raises:
        SourceError: There is none in the folder, or there are several.
    """
    if not place or not Path(place).is_dir():
        return place
    files = sorted(Path(place).glob(f"*{ending}"))
    if not files:
        raise SourceError(on_one_line(f"{place}: is a folder without a file *{ending}: {instead}"))
    if len(files) > 1:
        raise SourceError(on_one_line(f"{place}: holds several recordings: name one, such as {name}:{files[0]}"))
    return str(files[0])


class RecordingSink(Sink):
    """Writes a file. It appears in its place when it is closed: whole, or not at all."""

    ending: ClassVar[str]
    """Such a sink on the command line, as an example."""
    version: ClassVar[Version]

    live = False

    def __init__(self, place: str) -> None:
        super().__init__(place)
        if not place:
            raise SinkError(f"a recording needs the name of its file, as in {self.ending}")
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
        """Keep the names that topics have in the team's files."""
        self.original = original

    def advertise(self, topics: Mapping[str, str]) -> None:
        """Check that all these types are known."""
        for topic, kind in topics.items():
            with self.as_sink_errors(topic):
                types_of(self.version).definition(kind)

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Append a message. The time of its publication is also that of its reception."""
        if not 0 <= at_ns < _END_OF_TIME:
            raise SinkError(on_one_line(f"{self.place}: {topic}: a recording has no time {at_ns}"))
        with self.as_sink_errors(topic):
            self.write(topic, kind, fields, at_ns)

    def close(self) -> None:
        """Put the file in its place. If that fails nothing is left behind."""
        if self._open:
            self._open = False
            try:
                with self.as_sink_errors():
                    self.finish()
                    self.file.keep()
            finally:
                self.discard()

    def discard(self) -> None:
        """Leave nothing behind."""
        self._open = False
        self.file.discard()

    @contextmanager
    def as_sink_errors(self, topic: str = "") -> Iterator[None]:
        """Raise errors as `SinkError`, with the name of the file and of the topic."""
        where = f"{self.place}: {topic}" if topic else self.place
        try:
            yield
        except (FieldsError, UnknownTypeError) as error:
            raise SinkError(on_one_line(f"{where}: {error}")) from error
        except OSError as error:
            why = error.strerror or str(error)
            missing = isinstance(error, FileNotFoundError) and not Path(self.place).absolute().parent.exists()
            hint = ": its folder does not exist, make it first" if missing else ""
            raise SinkError(on_one_line(f"{self.place}: {why}{hint}")) from error
