"""Calls of ROS 2 services over DDS, in the form used by the middleware for Cyclone DDS (`dds_service.py`)."""

from __future__ import annotations

import secrets
import struct
from collections.abc import Mapping

from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import Source
from robochoc.ros.live.dds import DdsSource
from robochoc.ros.live.dds_participant import REQUESTS_MAX, Participant, ServiceEnd, Subscription
from robochoc.ros.live.dds_place import DdsPlace, Quality
from robochoc.ros.live.dds_service import split_request, with_header
from robochoc.ros.live.service_calls import ServiceCalls
from robochoc.ros.message_types import FieldsError, types_of

_QUALITY = Quality(reliable=True, latched=False, depth=REQUESTS_MAX)


class DdsCalls(ServiceCalls):
    """Calls services in a DDS domain. The header of a request has this client's id, and the number of the call.

    Args:
        place: As for the sink `dds`; only the domain and partitions may be given.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place)
        found = DdsPlace.parse(place, _QUALITY, ("partition",), SinkError)
        self.where = f"domain {found.domain} of DDS"
        self._client = secrets.randbits(64)
        self._ends: dict[str, ServiceEnd] = {}
        self._subscription: Subscription | None = None
        self._participant = Participant(found, SinkError)

    def prepare(self, services: Mapping[str, str]) -> None:
        """Prepare calls of `services`."""
        super().prepare(services)
        self._ends = {name: self._participant.call(name, kind) for name, kind in services.items()}
        self._subscription = self._participant.listen([*self._ends.values()], self._receive)

    def has_server(self, service: str) -> bool:
        """Return whether a server reads requests, and its answers can be read."""
        end = self._ends[service]
        return end.has_readers() and end.has_writers()

    def source(self) -> Source:
        """Return a source in the same domain."""
        return DdsSource(self.place)

    def close(self) -> None:
        """Leave the domain."""
        if self._subscription is not None:
            self._subscription.close()
            self._subscription = None
        self._ends.clear()
        self._participant.close()

    def _send(self, number: int, service: str, fields: Fields, wait_s: float) -> None:  # noqa: ARG002 - DDS has no limit
        content = types_of(2).encode(f"{self._kinds[service]}_Request", fields)
        self._ends[service].write(with_header(content, struct.pack("<Qq", self._client, number)))

    def _receive(self, service: str, _: str, content: bytes) -> None:
        """Store an answer; called in the subscription's thread. Other clients' answers are ignored."""
        found = split_request(content)
        if found is None:
            return
        header, body = found
        client, number = struct.unpack("<Qq", header)
        if client != self._client:
            return
        try:
            self._put(number, types_of(2).decode(f"{self._kinds[service]}_Response", body))
        except FieldsError as error:
            self._put(number, None, on_one_line(f"the answer of {service} cannot be read: {error}"))
