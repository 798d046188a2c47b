"""Calls of services through a rosbridge, which calls them in its ROS."""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import Source
from robochoc.ros.live.rosbridge import RosbridgeSource
from robochoc.ros.live.rosbridge_connection import Connection, MalformedMessageError, incoming, outgoing
from robochoc.ros.live.service_calls import ServiceCalls

_MARK = "robochoc:"
"""The beginning of the ids of our calls, which distinguishes them from roslibpy's."""


class RosbridgeCalls(ServiceCalls):
    """Calls services through a rosbridge.

    Args:
        place: As for the sink `rosbridge`.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._connection = Connection(place, SinkError)
        self.where = f"rosbridge at {self._connection.url}"
        self._connection.intercept("service_response", self._receive)

    def has_server(self, service: str) -> None:  # noqa: ARG002 - a rosbridge does not tell
        """Return None, since a rosbridge reports a missing service only as the answer to a call."""
        return

    def check(self) -> None:
        """Raise `SinkError` if the connection is lost."""
        self._connection.check()

    def source(self) -> Source:
        """Return a source with the same rosbridge."""
        return RosbridgeSource(self.place)

    def close(self) -> None:
        """End the connection."""
        self._connection.close()

    def _send(self, number: int, service: str, fields: Fields, wait_s: float) -> None:  # noqa: ARG002 - see `ServiceCalls`
        call = {"op": "call_service", "id": f"{_MARK}{number}", "service": service, "type": self._kinds[service]}
        self._connection.send({**call, "args": outgoing(fields)})

    def _receive(self, message: Mapping[str, object]) -> bool:
        """Store an answer; called in the connection's thread. Return whether it answers one of our calls."""
        number = call_number(message)
        if number is None:
            return False
        values, service = message.get("values"), message.get("service")
        if message.get("result") is False:
            self._put(number, None, shortened(on_one_line(f"the rosbridge cannot call {service}: {str(values)[:200]}")))
            return True
        try:
            self._put(number, incoming(values or {})[0])
        except MalformedMessageError as error:
            self._put(number, None, on_one_line(f"the answer of a service cannot be read: {error}"))
        return True


def call_number(message: Mapping[str, object]) -> int | None:
    """Return the number of our call that `message` answers; None for other messages."""
    text = message.get("id")
    if not isinstance(text, str) or not text.startswith(_MARK) or len(text) > len(_MARK) + 18:
        return None
    digits = text.removeprefix(_MARK)
    return int(digits) if digits.isascii() and digits.isdecimal() else None
