"""Sinks and sources for a ROS 2 with zenoh as middleware (rmw_zenoh). No ROS is required on this machine."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from functools import partial

from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import ReceivedMessage, SourceError
from robochoc.ros.live.rmw_zenoh_keys import NO_HASH, ZenohTopic
from robochoc.ros.live.rmw_zenoh_session import RosPublisher, RosSession
from robochoc.ros.live.transport import LiveSink, LiveSource
from robochoc.ros.message_types import FieldsError, UnknownTypeError, types_of
from robochoc.ros.type_hashes import type_hash

MESSAGE_BYTES_MAX = 256 * 1024
"""Longer messages are ignored: reports are short."""
_CHECK_S = 1.0


class RmwZenohSink(LiveSink):
    """Publishes through a zenoh router. Topics are reliable and transient local: late subscribers get the last message.

    With `ROS_DISTRO=humble`, keys have the form of ROS 2 Humble, without a hash of the type.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._is_humble = os.environ.get("ROS_DISTRO") == "humble"
        self._publishers: dict[str, RosPublisher] = {}
        self._session = RosSession(place, SinkError)

    def _announce(self, topics: Mapping[str, str]) -> None:
        """Declare publishers, which are then visible in ROS 2."""
        for topic, kind in topics.items():
            try:
                hashed = type_hash(kind)
            except UnknownTypeError as error:
                raise SinkError(on_one_line(f"{topic}: {error}")) from error
            named = ZenohTopic.for_topic(topic, kind, NO_HASH if self._is_humble else hashed)
            self._publishers[topic] = self._session.publisher(named)

    def _send(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:
        """Send a message in the background, stamped with `at_ns`."""
        try:
            content = types_of(2).encode(kind, fields)
        except FieldsError as error:
            raise SinkError(on_one_line(f"{topic}: {error}")) from error
        self._session.wait_for_link()
        self._publishers[topic].put(content, at_ns)

    def close(self) -> None:
        """Wait until the router has received all messages."""
        try:
            self._session.wait_for_link()
        except SinkError:
            self.discard()
            raise
        if not self._session.close():
            raise SinkError(f"the zenoh router {self._session.router} does not accept our messages; see its log")

    def discard(self) -> None:
        """End the session."""
        self._session.discard()


class RmwZenohSource(LiveSource):
    """Receives through a zenoh router. Messages that are malformed or with another type definition are ignored."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._session = RosSession(place, SourceError)

    def listen(self, topics: Mapping[str, str]) -> None:
        """Subscribe to `topics`."""
        for name, kind in topics.items():
            try:
                topic = ZenohTopic.for_topic(name, kind, type_hash(kind))
            except UnknownTypeError as error:
                raise SourceError(on_one_line(f"{name}: {error}")) from error
            self._session.subscribe(topic, partial(self._receive, topic, kind))

    def next(self, wait_s: float) -> ReceivedMessage | None:
        """Return the next message; check the link once a second."""
        until = time.monotonic() + wait_s
        while True:
            left = until - time.monotonic()
            received = self._inbox.get(min(max(left, 0), _CHECK_S))
            if received is not None:
                return received
            self._session.check()
            if left <= 0:
                return None

    def close(self) -> None:
        """End the session."""
        self._session.discard()

    def _receive(self, topic: ZenohTopic, kind: str, key: str, content: bytes) -> None:
        if key.rpartition("/")[2] not in {topic.hash, NO_HASH} or len(content) > MESSAGE_BYTES_MAX:
            return
        try:
            fields = types_of(2).decode(kind, content)
        except FieldsError:
            return
        self._put(topic.name, kind, fields)
