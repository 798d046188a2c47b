"""rosbridge: topics of a ROS 1 or a ROS 2 over a WebSocket, so that neither has to be installed here."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.live.rosbridge_connection import Connection, MalformedMessageError, incoming, outgoing
from robochoc.ros.live.transport import LiveSink, LiveSource

_LOOK_EVERY = 100
"""Messages published between two looks at how many bytes are on their way."""


class RosbridgeSink(LiveSink):
    """Publishes through a rosbridge. Topics are latched: later subscribers receive the last message of each."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._connection = Connection(place, SinkError)
        self._topics: dict[str, Any] = {}
        self._published = 0

    def advertise(self, topics: Mapping[str, str]) -> None:
        """Announce new topics to the server, whose complaints are raised here."""
        self._check()
        super().advertise(topics)

    def _announce(self, topics: Mapping[str, str]) -> None:
        for name, kind in topics.items():
            topic = self._connection.topic(name, kind)
            topic.advertise()
            self._topics[name] = topic

    def _send(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:  # noqa: ARG002
        """Send a message in the background."""
        self._topics[topic].publish(outgoing(fields))
        self._published += 1
        if self._published % _LOOK_EVERY == 0 and self._connection.is_ahead():
            self._connection.drain()

    def close(self) -> None:
        """Wait until the server has read everything."""
        try:
            self._check()
            self._connection.drain()
            is_confirmed = self._connection.confirm()
            self._check()
        except SinkError:
            self._connection.abort()
            raise
        if not self._connection.close() and not is_confirmed:
            raise SinkError(f"the rosbridge at {self._connection.url} has not said that it has read all; see its log")

    def discard(self) -> None:
        """End the connection."""
        self._connection.abort()

    def _check(self) -> None:
        self._connection.check()
        if self._connection.complaint:
            said = f"the rosbridge at {self._connection.url} complains: {self._connection.complaint}"
            raise SinkError(f"{said}; see its log")


class RosbridgeSource(LiveSource):
    """Receives through a rosbridge. Malformed messages, and those of other topics, are ignored."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._connection = Connection(place, SourceError)
        self._over = self._connection.over
        self._connection.on_over = self._inbox.wake

    def listen(self, topics: Mapping[str, str]) -> None:
        """Subscribe to `topics`."""
        self._connection.check()
        for name, kind in topics.items():
            topic = self._connection.topic(name, kind)
            topic.subscribe(partial(self._receive, name, kind))

    def _check(self) -> None:
        self._connection.check()

    def close(self) -> None:
        """End the connection."""
        self._connection.close()

    def _receive(self, topic: str, kind: str, message: object) -> None:
        try:
            fields, weight = incoming(message)
        except MalformedMessageError:
            return
        self._put(topic, kind, fields, weight)
