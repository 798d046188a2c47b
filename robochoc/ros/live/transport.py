"""The base classes of live connections to ROS: topics are announced once, and received messages wait in an inbox."""

from __future__ import annotations

import importlib
import re
import threading
import time
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import Any

from robochoc.formats.diagnostics import shortened
from robochoc.robots.inbox import MessageInbox, weight_of
from robochoc.robots.sink import Fields, Sink, SinkError
from robochoc.robots.source import ReceivedMessage, Source, SourceError

STUCK_S = 10.0
"""The longest time in which a subscriber may leave messages unread or unacknowledged, in seconds."""
LINGER_S = 0.3
"""The time that topics remain after the last message, in seconds: then some subscribers drop unread messages."""
SETTLE_S = 0.3
"""The time without a new subscriber after which all are assumed to be connected, in seconds."""
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/([A-Za-z][A-Za-z0-9_]*)")

ErrorClass = type[SinkError] | type[SourceError]


class LiveSink(Sink):
    """Announces each topic before its first message. Methods raise `SinkError`."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._announced: dict[str, str] = {}

    def advertise(self, topics: Mapping[str, str]) -> None:
        """Announce the new ones among `topics`."""
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

    _ended: threading.Event | None = None
    """Set when no more messages can arrive; None for transports that cannot detect it."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._inbox = MessageInbox()

    def next(self, wait_s: float) -> ReceivedMessage | None:
        """Return the oldest message, or the first to arrive within `wait_s`; None if none arrives."""
        received = self._inbox.get(wait_s, stopped=self._ended)
        if received is None:
            self._check()
        return received

    def _check(self) -> None:
        """Raise `SourceError` if no more messages can arrive."""

    def _put(self, topic: str, kind: str, fields: Fields, weight: int | None = None) -> None:
        """Store a message that has just arrived."""
        received = ReceivedMessage(topic, kind, fields, time.time_ns())
        self._inbox.put(received, weight_of(fields) if weight is None else weight)


def await_subscribers(counts: Callable[[], Sequence[int]], wait_s: float) -> None:
    """Wait until each topic has a subscriber and no more join, since these would miss messages published earlier.

    Args:
        counts: Returns the number of subscribers to each topic.
        wait_s: The longest wait, in seconds.
    """
    until = time.monotonic() + wait_s
    before, since, pause_s = 0, time.monotonic(), 0.01
    while time.monotonic() < until:
        found = counts()
        now = time.monotonic()
        if sum(found) != before:
            before, since = sum(found), now
        if all(found) and now - since >= SETTLE_S:
            return
        time.sleep(pause_s)
        pause_s = min(2 * pause_s, 0.1)


def succeeds_in_time(work: Callable[[], object], limit_s: float) -> bool:
    """Return whether `work`, a library call that may never return, succeeds within `limit_s` seconds.

    The call runs in a thread, which may remain after a timeout. Signals are handled during the wait.
    """
    errors: list[Exception] = []

    def run() -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 - reported as False
            errors.append(error)

    thread = threading.Thread(target=run, daemon=True, name="library call")
    thread.start()
    thread.join(limit_s)
    return not thread.is_alive() and not errors


def message_class(kind: str, failed: ErrorClass, library: str = "rospy") -> Any:  # noqa: ANN401 - messages are untyped
    """Return the class in `library` for the ROS type `kind`, in either spelling. Raises `failed`."""
    found = _TYPE.fullmatch(kind.replace("/msg/", "/"))
    try:
        package: ModuleType = importlib.import_module(f"{found[1]}.msg" if found else "")
        return getattr(package, found[2] if found else "")
    except (ImportError, AttributeError, ValueError) as missing:
        where = f"install the package {found[1]!r} for Python" if found else "expected PACKAGE/TYPE"
        raise failed(f"{library} has no message type {shortened(kind)!r}; {where}") from missing
