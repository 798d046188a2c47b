"""Services in ROS 1 or ROS 2 through a rosbridge, which forwards the requests of its clients."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.live.action_goals import ActionGoals
from robochoc.ros.live.rosbridge_connection import Connection, MalformedMessageError, incoming, outgoing
from robochoc.ros.live.rosbridge_goals import RosbridgeGoals
from robochoc.ros.live.services import ImmediateServices, Refuse, ServiceRequest, Services, known_fields


class RosbridgeServices(Services):
    """Offers services through a rosbridge. A request's `client` is the number assigned by the bridge.

    Args:
        place: As for the sink `rosbridge`.
        services: The type of each service, such as `std_srvs/Trigger`.
        refuse: Returns the fields of an answer that refuses a request for a given reason.
        immediate: The services that are answered without a queue.
    """

    def __init__(
        self, place: str, services: Mapping[str, str], refuse: Refuse, immediate: ImmediateServices | None = None
    ) -> None:
        super().__init__(services, refuse, immediate)
        self._topics: dict[str, Any] = {}
        self._action: RosbridgeGoals | None = None
        self._connection = Connection(place, SinkError)
        self.where = f"rosbridge at {self._connection.url}"
        for name, kind in services.items():
            self._connection.serve(name, kind, partial(self._receive, name))

    def check(self) -> None:
        """Raise `SinkError` if the connection is lost, or if the server reports an error, such as a refused service."""
        self._connection.check()
        if self._connection.error:
            problem = f"the rosbridge at {self._connection.url} reports an error: {self._connection.error}"
            raise SinkError(f"{problem}; see its log")

    def reply(self, request: ServiceRequest, fields: Fields) -> None:
        """Answer `request`."""
        values = outgoing(known_fields(self._kinds[request.name], fields))
        self._connection.respond(request.name, request.client, values)

    def announce(self, topic: str, kind: str) -> None:
        """Announce a topic. The server stores the last message for later subscribers."""
        self._topics[topic] = self._connection.topic(topic, kind)
        self._topics[topic].advertise()

    def publish(self, topic: str, kind: str, fields: Fields) -> None:  # noqa: ARG002 - it was announced with it
        """Publish a message, or drop it if the server is far behind."""
        if not self._connection.ended.is_set() and not self._connection.is_ahead():
            self._topics[topic].publish(outgoing(fields))

    def offer_action(self, name: str, kind: str, goals: ActionGoals) -> None:
        """Offer the action `name` of the type `kind`, such as `robochoc_msgs/Decide`."""
        goals.clients = self._action = RosbridgeGoals(name, kind, goals, self._connection)

    def close(self) -> None:
        """Refuse the waiting requests, stop offering services, and end the connection."""
        try:
            if self._action is not None:
                self._action.stop()
            self._refuse_waiting()
            self._connection.stop_serving(self._kinds)
            with suppress(SinkError):  # a lost server needs no answer
                self._connection.drain()
        finally:
            self._connection.close()

    def _receive(self, name: str, message: object) -> None:
        """Accept a request, in the connection's thread. Requests without an `id` cannot be answered: ignore them."""
        if not isinstance(message, Mapping) or not isinstance(client := message.get("id"), str | int):
            return
        request = ServiceRequest(name, {}, client)
        try:
            fields, _ = incoming(message.get("args") or {})
        except MalformedMessageError as wrong:
            self._refuse_now(request, f"the request cannot be read as one of {self._kinds[name]}: {wrong}")
            return
        self._accept(request._replace(fields=fields))
