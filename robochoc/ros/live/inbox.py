"""What a live source has heard and nobody has taken yet: bounded, whoever talks."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import NamedTuple

from robochoc.ros.source import ReceivedMessage

PER_TOPIC = 100
"""Messages of one topic that are kept. The newest are: they tell the situation as it is."""
WEIGHT = 16_000_000
"""Characters and fields that are kept of all topics together."""


class _Kept(NamedTuple):
    number: int
    heard: ReceivedMessage
    weight: int


class Inbox:
    """Messages in the order in which they came. Any thread may put some in; one takes them.

    A topic that is too loud loses its own oldest messages, not those of others: batteries that report ten times a
    second while the team solves do not push out that a cell is blocked.
    """

    def __init__(self, per_topic: int = PER_TOPIC, weight: int = WEIGHT) -> None:
        self._per_topic, self._most = per_topic, weight
        self._topics: dict[str, deque[_Kept]] = {}
        self._weight = 0
        self._count = 0
        self._came = threading.Condition()

    def put(self, heard: ReceivedMessage, weight: int = 1) -> None:
        """Keep `heard`, which weighs this many characters and fields."""
        with self._came:
            kept = self._topics.setdefault(heard.topic, deque())
            kept.append(_Kept(self._count, heard, weight))
            self._count += 1
            self._weight += weight
            if len(kept) > self._per_topic:
                self._weight -= kept.popleft().weight
            while self._weight > self._most:
                loudest = max(self._topics.values(), key=lambda kept: sum(one.weight for one in kept))
                self._weight -= loudest.popleft().weight
            self._came.notify()

    def wake(self) -> None:
        """Whoever waits need not wait any longer: nothing more will come."""
        with self._came:
            self._came.notify()

    def get(self, wait_s: float, *, over: threading.Event | None = None) -> ReceivedMessage | None:
        """The oldest message; None if none comes within `wait_s`, or before it is `over`."""
        until = time.monotonic() + wait_s
        with self._came:
            while True:
                waiting = [kept for kept in self._topics.values() if kept]
                if waiting:
                    oldest = min(waiting, key=lambda kept: kept[0].number).popleft()
                    self._weight -= oldest.weight
                    return oldest.heard
                left = until - time.monotonic()
                if left <= 0 or (over is not None and over.is_set()):
                    return None
                self._came.wait(left)
