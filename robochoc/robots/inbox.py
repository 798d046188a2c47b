"""The inbox of a live source: a bounded queue of received messages."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import NamedTuple

from robochoc.robots.source import ReceivedMessage

PER_TOPIC_MAX = 100
"""The maximum number of messages stored for each topic; the newest are kept."""
WEIGHT_MAX = 16_000_000
"""The maximum number of characters and fields stored for all topics together."""


class _StoredMessage(NamedTuple):
    number: int
    received: ReceivedMessage
    weight: int


class MessageInbox:
    """Stores messages in the order of their arrival. Any thread may add messages; one thread reads them.

    If a topic has too many messages, its own oldest messages are dropped, not those on other topics. So ten battery
    reports per second during a search do not displace a report of a blocked cell.
    """

    def __init__(self, per_topic: int = PER_TOPIC_MAX, weight: int = WEIGHT_MAX) -> None:
        self._per_topic, self._most = per_topic, weight
        self._topics: dict[str, deque[_StoredMessage]] = {}
        self._weight = 0
        self._count = 0
        self._arrived = threading.Condition()

    def put(self, received: ReceivedMessage, weight: int = 1) -> None:
        """Add `received`, whose `weight` is the number of its characters and fields."""
        with self._arrived:
            stored = self._topics.setdefault(received.topic, deque())
            stored.append(_StoredMessage(self._count, received, weight))
            self._count += 1
            self._weight += weight
            if len(stored) > self._per_topic:
                self._weight -= stored.popleft().weight
            while self._weight > self._most:
                loudest = max(self._topics.values(), key=lambda stored: sum(one.weight for one in stored))
                self._weight -= loudest.popleft().weight
            self._arrived.notify()

    def wake(self) -> None:
        """Wake the waiting thread, since nothing more will arrive."""
        with self._arrived:
            self._arrived.notify()

    def get(self, wait_s: float, *, stopped: threading.Event | None = None) -> ReceivedMessage | None:
        """Return the oldest message; None if none arrives within `wait_s`, or before `stopped` is set."""
        until = time.monotonic() + wait_s
        with self._arrived:
            while True:
                waiting = [stored for stored in self._topics.values() if stored]
                if waiting:
                    oldest = min(waiting, key=lambda stored: stored[0].number).popleft()
                    self._weight -= oldest.weight
                    return oldest.received
                left = until - time.monotonic()
                if left <= 0 or (stopped is not None and stopped.is_set()):
                    return None
                self._arrived.wait(left)


def weight_of(value: object) -> int:
    """Return the number of characters and fields in `value`."""
    match value:
        case dict():
            return 1 + sum(map(weight_of, value.values()))
        case list() | tuple():
            return 1 + sum(map(weight_of, value))
        case str() | bytes():
            return 1 + len(value)
        case _:
            return 1
