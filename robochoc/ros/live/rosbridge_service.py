"""Services of a ROS 1 or a ROS 2 through a rosbridge, which passes the requests of its clients on."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.live.rosbridge_connection import Connection, MalformedMessageError, incoming, outgoing
from robochoc.ros.live.services import AtOnce, Refuse, Request, Services, known_fields


class RosbridgeServices(Services):
    """Offers services through a rosbridge. The client of a request is the number that the bridge has given it.

    Args:
        place: As for the sink `rosbridge`.
        services: The type of each service, such as `std_srvs/Trigger`.
        refuse: Makes the fields of an answer that refuses, for a reason in words.
        at_once: Those of the services that do not wait for their turn.
    """

    def __init__(self, place: str, services: Mapping[str, str], refuse: Refuse, at_once: AtOnce | None = None) -> None:
        super().__init__(services, refuse, at_once)
        self._topics: dict[str, Any] = {}
        self._connection = Connection(place, SinkError)
        self.where = f"rosbridge at {self._connection.url}"
        for name, kind in services.items():
            self._connection.serve(name, kind, partial(self._receive, name))

    def check(self) -> None:
        """Raise `SinkError` if the connection is lost, or the server does not offer a service for us."""
        self._connection.check()
        if self._connection.complaint:
            said = f"the rosbridge at {self._connection.url} complains: {self._connection.complaint}"
            raise SinkError(f"{said}; see its log")

    def reply(self, request: Request, fields: Fields) -> None:
        """Answer `request`."""
        told = outgoing(known_fields(self._kinds[request.name], fields))
        self._connection.respond(request.name, request.client, told)

    def announce(self, topic: str, kind: str) -> None:
        """Announce a topic. The server keeps the last message for later subscribers."""
        self._topics[topic] = self._connection.topic(topic, kind)
        self._topics[topic].advertise()

    def publish(self, topic: str, kind: str, fields: Fields) -> None:  # noqa: ARG002 - it was announced with it
        """Publish a message, unless the server is far behind."""
        if not self._connection.over.is_set() and not self._connection.is_ahead():
            self._topics[topic].publish(outgoing(fields))

    def close(self) -> None:
        """Refuse what still waits, take the services back, and end the connection."""
        try:
            self._refuse_waiting()
            self._connection.stop_serving(self._kinds)
            with suppress(SinkError):  # whoever is gone needs no answer
                self._connection.drain()
        finally:
            self._connection.close()

    def _receive(self, name: str, message: object) -> None:
        """Take a request, in the thread of the connection. One without an `id` cannot be answered."""
        if not isinstance(message, Mapping) or not isinstance(client := message.get("id"), str | int):
            return
        request = Request(name, {}, client)
        try:
            fields, _ = incoming(message.get("args") or {})
        except MalformedMessageError as wrong:
            self._refuse_now(request, f"the request cannot be read as one of {self._kinds[name]}: {wrong}")
            return
        self._take(request._replace(fields=fields))
