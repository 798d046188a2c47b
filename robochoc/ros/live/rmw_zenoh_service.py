"""Services in a ROS 2 network with zenoh as middleware.

A request is a zenoh query. The attachments of request and answer contain the client's id.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from functools import partial

from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.live.rmw_zenoh import MESSAGE_BYTES_MAX
from robochoc.ros.live.rmw_zenoh_keys import NO_HASH, ZenohTopic
from robochoc.ros.live.rmw_zenoh_session import RosPublisher, RosQuery, RosSession
from robochoc.ros.live.services import ImmediateServices, Refuse, ServiceRequest, Services, known_fields
from robochoc.ros.message_types import FieldsError, types_of
from robochoc.ros.type_hashes import service_hash, type_hash


class RmwZenohServices(Services):
    """Offers services through a zenoh router, as a node visible to `ros2 service list`. Clients wait for each answer.

    With `ROS_DISTRO=humble`, keys have the form of ROS 2 Humble, without a hash of the type.

    Args:
        place: As for the sink `rmw_zenoh`.
        services: The type of each service, such as `std_srvs/Trigger`.
        refuse: Returns the fields of an answer that refuses a request for a given reason.
        immediate: The services that are answered without a queue.
    """

    def __init__(
        self, place: str, services: Mapping[str, str], refuse: Refuse, immediate: ImmediateServices | None = None
    ) -> None:
        super().__init__(services, refuse, immediate)
        self._is_humble = os.environ.get("ROS_DISTRO") == "humble"
        self._publishers: dict[str, RosPublisher] = {}
        self._session = RosSession(place, SinkError)
        self.where = f"zenoh router {self._session.router}"
        try:
            for name, kind in services.items():
                named = ZenohTopic.for_topic(name, kind, NO_HASH if self._is_humble else service_hash(kind))
                self._session.serve(named, partial(self._receive, name, kind))
        except BaseException:
            self._session.close()
            raise

    def check(self) -> None:
        """Raise `SinkError` if the router has been out of reach for a long time."""
        self._session.check()

    def reply(self, request: ServiceRequest, fields: Fields) -> None:
        """Answer `request`."""
        _reply(request.client, self._kinds[request.name], fields)

    def announce(self, topic: str, kind: str) -> None:
        """Announce a topic. The last message is stored for later subscribers."""
        hashed = NO_HASH if self._is_humble else type_hash(kind)
        self._publishers[topic] = self._session.publisher(ZenohTopic.for_topic(topic, kind, hashed))

    def publish(self, topic: str, kind: str, fields: Fields) -> None:
        """Publish a message."""
        self._publishers[topic].put(types_of(2).encode(kind, fields), time.time_ns())

    def close(self) -> None:
        """Refuse the waiting requests, and leave the router."""
        self._refuse_waiting()
        self._session.close()

    def _receive(self, name: str, kind: str, content: bytes, query: RosQuery) -> None:
        """Accept a request; called in a thread of zenoh."""
        if len(content) > MESSAGE_BYTES_MAX:
            why = f"the request has {len(content):,} bytes; at most {MESSAGE_BYTES_MAX:,} are accepted"
            _reply(query, kind, self._refuse(why))
            return
        try:
            fields = types_of(2).decode(f"{kind}_Request", content)
        except FieldsError:
            _reply(query, kind, self._refuse(f"the request cannot be read as one of {kind}"))
            return
        self._accept(ServiceRequest(name, fields, query))


def _reply(query: RosQuery, kind: str, fields: Fields) -> None:
    query.reply(types_of(2).encode(f"{kind}_Response", known_fields(kind, fields)))
