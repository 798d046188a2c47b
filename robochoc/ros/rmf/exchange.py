"""Sends and receives RMF's messages through a middleware: the sinks and sources dds, rmw_zenoh and rosbridge."""

from __future__ import annotations

import time
from collections.abc import Collection
from types import TracebackType
from typing import Self

from robochoc.robots.connections import open_sink, open_source
from robochoc.robots.sink import Sink, SinkError
from robochoc.robots.source import Source
from robochoc.ros.rmf.messages import TOPICS, Message, fields_of, message_of

MIDDLEWARES = ("dds", "rmw_zenoh", "rosbridge")
_OPTIONS = {"dds": ("reliability=reliable&depth=100", "reliability=reliable&depth=100")}
"""The options of the sink and the source: no message of a burst may be dropped."""


class Exchange:
    """A connection to a middleware; a context manager. Methods raise `SinkError` and `SourceError`.

    Args:
        place: The middleware, such as `dds:5`, `rmw_zenoh://HOST:PORT` or `rosbridge://HOST:PORT`.
        sends: The classes of messages that are sent.
        receives: The classes of messages that are received.
    """

    def __init__(self, place: str, sends: Collection[type[Message]], receives: Collection[type[Message]]) -> None:
        kind = place.partition(":")[0]
        if kind not in MIDDLEWARES:
            raise SinkError(f"{place}: unknown middleware; use {', '.join(MIDDLEWARES)}, such as dds:5")
        outward, inward = _OPTIONS.get(kind, ("", ""))
        self._as_json = kind == "rosbridge"
        self._sink: Sink = open_sink(_with_options(place, outward))
        try:
            self._source: Source = open_source(_with_options(place, inward))
            try:
                self._sink.advertise(dict(TOPICS[one] for one in sends))
                self._source.listen(dict(TOPICS[one] for one in receives))
            except BaseException:
                self._source.close()
                raise
        except BaseException:
            self._sink.discard()
            raise

    def send(self, message: Message) -> None:
        """Send a message."""
        topic, kind = TOPICS[type(message)]
        self._sink.publish(topic, kind, fields_of(message, as_json=self._as_json), time.time_ns())

    def next(self, wait_s: float) -> Message | None:
        """Return the next message; None if none arrives within `wait_s`, or if it is malformed."""
        received = self._source.next(wait_s)
        return None if received is None else message_of(received.topic, received.fields)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._source.close()
        if error is None:
            self._sink.close()
        else:
            self._sink.discard()


def _with_options(place: str, options: str) -> str:
    """Return a place with default options; those that are given come later, and count."""
    if not options:
        return place
    kind, _, rest = place.partition(":")
    where, _, given = rest.partition("?")
    return f"{kind}:{where}?{options}{f'&{given}' if given else ''}"
