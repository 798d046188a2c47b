"""Calls of services in a ROS 2 network with zenoh as middleware. A request is a zenoh query."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial

from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import Source
from robochoc.ros.live.rmw_zenoh import MESSAGE_BYTES_MAX, RmwZenohSource
from robochoc.ros.live.rmw_zenoh_keys import NO_HASH, ZenohTopic
from robochoc.ros.live.rmw_zenoh_session import RosClient, RosSession
from robochoc.ros.live.service_calls import ServiceCalls
from robochoc.ros.message_types import FieldsError, types_of
from robochoc.ros.type_hashes import service_hash


class RmwZenohCalls(ServiceCalls):
    """Calls services through a zenoh router, as a node visible to `ros2 node list`.

    With `ROS_DISTRO=humble`, keys have the form of ROS 2 Humble, without a hash of the type.

    Args:
        place: As for the sink `rmw_zenoh`.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._is_humble = os.environ.get("ROS_DISTRO") == "humble"
        self._clients: dict[str, RosClient] = {}
        self._session = RosSession(place, SinkError)
        self.where = f"zenoh router {self._session.router}"

    def prepare(self, services: Mapping[str, str]) -> None:
        """Prepare calls of `services`."""
        super().prepare(services)
        for name, kind in services.items():
            hashed = NO_HASH if self._is_humble else service_hash(kind)
            self._clients[name] = self._session.client(ZenohTopic.for_topic(name, kind, hashed))

    def has_server(self, service: str) -> bool:
        """Return whether a node that the router knows offers `service`."""
        return self._clients[service].has_server()

    def check(self) -> None:
        """Raise `SinkError` if the router has been out of reach for a long time."""
        self._session.check()

    def source(self) -> Source:
        """Return a source with the same router."""
        return RmwZenohSource(self.place)

    def close(self) -> None:
        """Leave the router."""
        self._session.close()

    def _send(self, number: int, service: str, fields: Fields, wait_s: float) -> None:
        content = types_of(2).encode(f"{self._kinds[service]}_Request", fields)
        self._clients[service].call(number, content, wait_s, partial(self._receive, number, service))

    def _receive(self, number: int, service: str, content: bytes | None) -> None:
        """Store an answer; called in a thread of zenoh. `content` is None if no answer will arrive."""
        if content is None:
            self._put(number, None, f"{service} has not answered")
            return
        if len(content) > MESSAGE_BYTES_MAX:
            self._put(number, None, f"the answer of {service} has {len(content):,} bytes")
            return
        try:
            self._put(number, types_of(2).decode(f"{self._kinds[service]}_Response", content))
        except FieldsError as error:
            self._put(number, None, on_one_line(f"the answer of {service} cannot be read: {error}"))
