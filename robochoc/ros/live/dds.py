"""Sinks and sources of ROS 2 topics over DDS. No ROS 2 is required on this machine.

A place is `dds:DOMAIN?OPTION=VALUE&...` (`dds_place.py`). Messages consist of the same bytes as in ROS 2.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from typing import NoReturn

from robochoc.robots.inbox import PER_TOPIC_MAX
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.live.dds_participant import MESSAGE_BYTES_MAX, Participant
from robochoc.ros.live.dds_place import DdsPlace, Quality
from robochoc.ros.live.transport import LINGER_S, STUCK_S, LiveSink, LiveSource, await_subscribers
from robochoc.ros.message_types import FieldsError, UnknownTypeError, types_of
from robochoc.ros.names import is_for_waypoints

WAIT_S = 2.0
"""The default wait for subscribers, in seconds."""

_PUBLISHED = Quality(reliable=True, latched=True, depth=1, wait_s=WAIT_S)
_RECEIVED = Quality(reliable=False, latched=False, depth=PER_TOPIC_MAX)
_OPTIONS = ("partition", "reliability", "durability", "depth")
_CDR = (b"\0\0", b"\0\1")
"""The first bytes of messages in CDR, big-endian and little-endian."""


class DdsSink(LiveSink):
    """Publishes in a DDS domain. Topics are latched, unless an option in the place changes that.

    The first message is sent when each waypoint topic has a subscriber, or after the longest wait.
    """

    def __init__(self, place: str) -> None:
        self._place = DdsPlace.parse(place, _PUBLISHED, (*_OPTIONS, "wait"), SinkError)
        super().__init__(f"domain {self._place.domain} of DDS")
        self._participant = Participant(self._place, SinkError)

    def _announce(self, topics: Mapping[str, str]) -> None:
        """Announce `topics`, and wait for the subscribers of waypoints."""
        for topic, kind in topics.items():
            self._participant.announce(topic, kind)
        self._await_subscribers([topic for topic, kind in topics.items() if is_for_waypoints(topic, kind)])

    def _send(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:  # noqa: ARG002
        """Send a message, after waiting for subscribers that are far behind."""
        try:
            content = types_of(2).encode(kind, fields)
        except (UnknownTypeError, FieldsError) as error:
            raise SinkError(f"{topic} cannot be published: {error}") from error
        if len(content) > MESSAGE_BYTES_MAX:
            problem = f"a message on {topic} has {len(content):,} bytes"
            raise SinkError(f"{problem}: DDS messages may have at most {MESSAGE_BYTES_MAX:,}")
        if not self._participant.write(topic, kind, content, STUCK_S):
            self._stuck()

    def close(self) -> None:
        """Wait until all subscribers have acknowledged everything."""
        try:
            until = time.monotonic() + STUCK_S
            for topic in self._announced:
                while not self._participant.is_acknowledged(topic):
                    if time.monotonic() > until:
                        self._stuck()
            if any(self._participant.subscribers(self._announced)):
                time.sleep(LINGER_S)
        finally:
            self.discard()

    def discard(self) -> None:
        """Leave the domain."""
        self._participant.close()

    def _await_subscribers(self, topics: Collection[str]) -> None:
        """Wait until each of `topics` has a subscriber and no more join, up to the place's `wait`."""
        if topics:
            await_subscribers(lambda: self._participant.subscribers(topics), self._place.quality.wait_s)

    def _stuck(self) -> NoReturn:
        raise SinkError(
            f"a subscriber in domain {self._place.domain} of DDS has not acknowledged any message for {STUCK_S:g} s; "
            "end it, or publish with reliability=best_effort"
        )


class DdsSource(LiveSource):
    """Receives messages in a DDS domain. Messages that do not match their type are ignored.

    By default, readers have ROS 2's quality of service for sensors, which accepts reliable and best-effort messages.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._participant = Participant(DdsPlace.parse(place, _RECEIVED, _OPTIONS, SourceError), SourceError)
        self._subscription = self._participant.subscribe({}, self._receive)

    def listen(self, topics: Mapping[str, str]) -> None:
        """Subscribe to `topics`."""
        self._subscription.close()
        self._subscription = self._participant.subscribe(topics, self._receive)

    def close(self) -> None:
        """Leave the domain."""
        self._subscription.close()
        self._participant.close()

    def _receive(self, topic: str, kind: str, content: bytes) -> None:
        if content[:2] not in _CDR:
            return
        try:
            fields = types_of(2).decode(kind, content)
        except FieldsError:
            return
        self._put(topic, kind, fields)
