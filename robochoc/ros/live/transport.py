"""The base of the five live connections to ROS: topics are announced once, and received messages wait in an inbox."""

from __future__ import annotations

import threading
import time
from abc import abstractmethod
from collections.abc import Mapping

from robochoc.robots.inbox import MessageInbox, weight_of
from robochoc.robots.sink import Fields, Sink
from robochoc.robots.source import ReceivedMessage, Source

STUCK_S = 10.0
"""The longest time for which a subscriber may leave messages unread or unacknowledged, in seconds."""
LINGER_S = 0.3
"""Seconds for which topics stay after the last message. Some subscribers drop unread messages when a topic ends."""


class LiveSink(Sink):
    """A sink that announces each topic before its first message. Methods raise `SinkError`."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._announced: dict[str, str] = {}

    def advertise(self, topics: Mapping[str, str]) -> None:
        """Announce those of `topics` that are new."""
        new = {topic: kind for topic, kind in topics.items() if topic not in self._announced}
        if new:
            self._announce(new)
            self._announced |= new

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Announce `topic` if it is new, and send a message."""
        self.advertise({topic: kind})
        self._send(topic, kind, fields, at_ns)

    @abstractmethod
    def _announce(self, topics: Mapping[str, str]) -> None:
        """Announce new topics, with their types."""

    @abstractmethod
    def _send(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Send a message on an announced topic. Most transports stamp it with their own clock."""


class LiveSource(Source):
    """A source whose messages arrive in other threads, by `_put`."""

    _over: threading.Event | None = None
    """Set once nothing more can arrive; None for transports that cannot tell."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._inbox = MessageInbox()

    def next(self, wait_s: float) -> ReceivedMessage | None:
        """Return the oldest message, or the first that arrives within `wait_s`."""
        received = self._inbox.get(wait_s, over=self._over)
        if received is None:
            self._check()
        return received

    def _check(self) -> None:
        """Raise `SourceError` if nothing more can arrive."""

    def _put(self, topic: str, kind: str, fields: Fields, weight: int | None = None) -> None:
        """Store a message that has just arrived."""
        received = ReceivedMessage(topic, kind, fields, time.time_ns())
        self._inbox.put(received, weight_of(fields) if weight is None else weight)
