"""Recordings as sinks: what MCAP files and ROS 1 bags have in common when they are written."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.sink import Fields, Sink, SinkError
from robochoc.ros.message_types import FieldsError, UnknownTypeError, Version, types_of
from robochoc.system.files import PendingFile

_END_OF_TIME = (1 << 32) * 10**9
"""The first time, in nanoseconds since the epoch, that ROS 1 cannot hold."""


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
        with self.sink_errors():
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
            with self.sink_errors(topic):
                types_of(self.version).definition(kind)

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Append a message. The time of its publication is also that of its reception."""
        if not 0 <= at_ns < _END_OF_TIME:
            raise SinkError(on_one_line(f"{self.place}: {topic}: a recording has no time {at_ns}"))
        with self.sink_errors(topic):
            self.write(topic, kind, fields, at_ns)

    def close(self) -> None:
        """Put the file in its place. If that fails nothing is left behind."""
        if self._open:
            self._open = False
            try:
                with self.sink_errors():
                    self.finish()
                    self.file.keep()
            finally:
                self.discard()

    def discard(self) -> None:
        """Leave nothing behind."""
        self._open = False
        self.file.discard()

    @contextmanager
    def sink_errors(self, topic: str = "") -> Iterator[None]:
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
