"""The inbox of a live source: a bounded queue of received messages."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import NamedTuple

from robochoc.robots.source import ReceivedMessage

PER_TOPIC_MAX = 100
"""The number of newest messages stored for each topic."""
WEIGHT_MAX = 16_000_000
"""The number of characters and fields stored for all topics together."""


class _Kept(NamedTuple):
    number: int
    received: ReceivedMessage
    weight: int


class MessageInbox:
    """Messages in the order of their arrival. Any thread may add some; one thread reads them.

    A topic with too many loses its own oldest messages, not those of others: batteries that report ten times a second
    while the team solves do not displace the message that a cell is blocked.
    """

    def __init__(self, per_topic: int = PER_TOPIC_MAX, weight: int = WEIGHT_MAX) -> None:
        self._per_topic, self._most = per_topic, weight
        self._topics: dict[str, deque[_Kept]] = {}
        self._weight = 0
        self._count = 0
        self._came = threading.Condition()

    def put(self, received: ReceivedMessage, weight: int = 1) -> None:
        """Add `received`, with this number of characters and fields."""
        with self._came:
            kept = self._topics.setdefault(received.topic, deque())
            kept.append(_Kept(self._count, received, weight))
            self._count += 1
            self._weight += weight
            if len(kept) > self._per_topic:
                self._weight -= kept.popleft().weight
            while self._weight > self._most:
                loudest = max(self._topics.values(), key=lambda kept: sum(one.weight for one in kept))
                self._weight -= loudest.popleft().weight
            self._came.notify()

    def wake(self) -> None:
        """Wake the waiting thread: nothing more will arrive."""
        with self._came:
            self._came.notify()

    def get(self, wait_s: float, *, over: threading.Event | None = None) -> ReceivedMessage | None:
        """Return the oldest message; None if none comes within `wait_s`, or before it is `over`."""
        until = time.monotonic() + wait_s
        with self._came:
            while True:
                waiting = [kept for kept in self._topics.values() if kept]
                if waiting:
                    oldest = min(waiting, key=lambda kept: kept[0].number).popleft()
                    self._weight -= oldest.weight
                    return oldest.received
                left = until - time.monotonic()
                if left <= 0 or (over is not None and over.is_set()):
                    return None
                self._came.wait(left)


def weight_of(value: object) -> int:
    """Return the number of characters and fields of `value`."""
    match value:
        case dict():
            return 1 + sum(map(weight_of, value.values()))
        case list() | tuple():
            return 1 + sum(map(weight_of, value))
        case str() | bytes():
            return 1 + len(value)
        case _:
            return 1
