"""Services of a ROS 2 whose middleware is zenoh. A request is a query, which names its client; so does the answer."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from functools import partial

from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.live.rmw_zenoh import MESSAGE_BYTES_MAX
from robochoc.ros.live.rmw_zenoh_keys import NO_HASH, Topic
from robochoc.ros.live.rmw_zenoh_session import RosPublisher, RosQuery, RosSession
from robochoc.ros.live.service_hashes import service_hash
from robochoc.ros.live.services import AtOnce, Refuse, Request, Services, known_fields
from robochoc.ros.message_types import FieldsError, types_of


class RmwZenohServices(Services):
    """Offers services by a zenoh router, as a node that `ros2 service list` sees. Clients wait for each answer.

    With `ROS_DISTRO=humble` keys are those of ROS 2 Humble, which have no hash of the type.

    Args:
        place: As for the sink `rmw_zenoh`.
        services: The type of each service, such as `std_srvs/Trigger`.
        refuse: Makes the fields of an answer that refuses, for a reason in words.
        at_once: Those of the services that do not wait for their turn.
    """

    def __init__(self, place: str, services: Mapping[str, str], refuse: Refuse, at_once: AtOnce | None = None) -> None:
        super().__init__(services, refuse, at_once)
        self._is_humble = os.environ.get("ROS_DISTRO") == "humble"
        self._publishers: dict[str, RosPublisher] = {}
        self._session = RosSession(place, SinkError)
        self.where = f"zenoh router {self._session.router}"
        try:
            for name, kind in services.items():
                named = Topic.of_service(name, kind, NO_HASH if self._is_humble else service_hash(kind))
                self._session.serve(named, partial(self._receive, name, kind))
        except BaseException:
            self._session.close()
            raise

    def check(self) -> None:
        """Raise `SinkError` if the router has been out of reach for long."""
        self._session.check()

    def reply(self, request: Request, fields: Fields) -> None:
        """Answer `request`."""
        _reply(request.client, self._kinds[request.name], fields)

    def announce(self, topic: str, kind: str) -> None:
        """Announce a topic. It keeps the last message for later subscribers, as all of ours in zenoh do."""
        type_hash = NO_HASH if self._is_humble else types_of(2).type_hash(kind)
        self._publishers[topic] = self._session.publisher(Topic.of(topic, kind, type_hash))

    def publish(self, topic: str, kind: str, fields: Fields) -> None:
        """Publish a message."""
        self._publishers[topic].put(types_of(2).encode(kind, fields), time.time_ns())

    def close(self) -> None:
        """Refuse what still waits, and leave the router."""
        self._refuse_waiting()
        self._session.close()

    def _receive(self, name: str, kind: str, content: bytes, query: RosQuery) -> None:
        """Take a request, in a thread of zenoh's."""
        if len(content) > MESSAGE_BYTES_MAX:
            why = f"the request has {len(content):,} bytes, and at most {MESSAGE_BYTES_MAX:,} are read"
            _reply(query, kind, self._refuse(why))
            return
        try:
            fields = types_of(2).decode(f"{kind}_Request", content)
        except FieldsError:
            _reply(query, kind, self._refuse(f"the request cannot be read as one of {kind}"))
            return
        self._take(Request(name, fields, query))


def _reply(query: RosQuery, kind: str, fields: Fields) -> None:
    query.reply(types_of(2).encode(f"{kind}_Response", known_fields(kind, fields)))
