"""Sinks and sources for ROS 1 or ROS 2 over a WebSocket (rosbridge). No ROS is required on this machine."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.live.rosbridge_connection import Connection, MalformedMessageError, incoming, outgoing
from robochoc.ros.live.transport import LiveSink, LiveSource

_CHECK_EVERY = 100
"""The number of published messages between two checks of the bytes still to be sent."""


class RosbridgeSink(LiveSink):
    """Publishes through a rosbridge. Topics are latched: later subscribers receive the last message of each topic."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._connection = Connection(place, SinkError)
        self._topics: dict[str, Any] = {}
        self._published = 0

    def advertise(self, topics: Mapping[str, str]) -> None:
        """Announce new topics to the server. Raises `SinkError` for errors reported by the server."""
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
        if self._published % _CHECK_EVERY == 0 and self._connection.is_ahead():
            self._connection.drain()

    def close(self) -> None:
        """Wait until the server has read all messages."""
        try:
            self._check()
            self._connection.drain()
            is_confirmed = self._connection.confirm()
            self._check()
        except SinkError:
            self._connection.abort()
            raise
        if not self._connection.close() and not is_confirmed:
            raise SinkError(
                f"the rosbridge at {self._connection.url} has not confirmed that it has read all messages; see its log"
            )

    def discard(self) -> None:
        """End the connection."""
        self._connection.abort()

    def _check(self) -> None:
        self._connection.check()
        if self._connection.error:
            problem = f"the rosbridge at {self._connection.url} reports an error: {self._connection.error}"
            raise SinkError(f"{problem}; see its log")


class RosbridgeSource(LiveSource):
    """Receives messages through a rosbridge. Malformed messages, and messages on other topics, are ignored."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._connection = Connection(place, SourceError)
        self._ended = self._connection.ended
        self._connection.on_end = self._inbox.wake

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
