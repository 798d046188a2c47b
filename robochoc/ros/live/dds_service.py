"""ROS 2 services over DDS, in the form used by the middleware for Cyclone DDS (rmw_cyclonedds_cpp).

A request is sent on `rq/NAMERequest`, its answer on `rr/NAMEReply`. Both begin with a header of 16 bytes: the client's
id and the number of the request, by which clients find their answers. Requests are untrusted. Every request with a
valid header is answered, even if its fields cannot be read.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Mapping

from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.live.dds_participant import MESSAGE_BYTES_MAX, Participant, ServiceEnd, Subscription
from robochoc.ros.live.dds_place import DdsPlace, Quality
from robochoc.ros.live.services import WAITING_MAX, ImmediateServices, Refuse, ServiceRequest, Services, known_fields
from robochoc.ros.message_types import FieldsError, types_of

MATCH_S = 1.0
"""The longest wait for the client's reader of answers, in seconds. It may be discovered later than the request."""
END_S = 2.0
"""The longest wait for clients to acknowledge the last answers, in seconds."""
_HEADER = 16
_ENCAPSULATION = 4
_ORDERS = {b"\0\0": ">", b"\0\1": "<"}


class DdsServices(Services):
    """Offers services in a DDS domain. A request's `client` is its 16-byte header.

    Args:
        place: As for the sink `dds`; only the domain and partitions may be given.
        services: The type of each service, such as `std_srvs/Trigger`.
        refuse: Returns the fields of an answer that refuses a request for a given reason.
        immediate: The services that are answered without a queue.
    """

    def __init__(
        self, place: str, services: Mapping[str, str], refuse: Refuse, immediate: ImmediateServices | None = None
    ) -> None:
        super().__init__(services, refuse, immediate)
        found = DdsPlace.parse(
            place, Quality(reliable=True, latched=False, depth=WAITING_MAX), ("partition",), SinkError
        )
        self.domain = found.domain
        self.where = f"domain {found.domain} of DDS"
        self._ends: dict[str, ServiceEnd] = {}
        self._participant = Participant(found, SinkError)
        self._subscription: Subscription | None = None
        try:
            for name, kind in services.items():
                self._ends[name] = self._participant.serve(name, kind)
            self._subscription = self._participant.listen([*self._ends.values()], self._receive)
        except BaseException:
            self.close()
            raise

    def reply(self, request: ServiceRequest, fields: Fields) -> None:
        """Answer `request`."""
        end = self._ends[request.name]
        until = time.monotonic() + MATCH_S
        while not end.has_readers() and time.monotonic() < until:
            time.sleep(0.01)
        self._write(request.name, request.client, fields)

    def announce(self, topic: str, kind: str) -> None:
        """Announce a topic."""
        self._participant.announce(topic, kind)

    def publish(self, topic: str, kind: str, fields: Fields) -> None:
        """Publish a message; drop it if a subscriber has no room."""
        self._participant.write(topic, kind, types_of(2).encode(kind, fields), 0)

    def close(self) -> None:
        """Refuse the waiting requests, and leave the domain."""
        if self._subscription is not None:
            self._subscription.close()
            self._subscription = None
        self._refuse_waiting()
        until = time.monotonic() + END_S
        for end in self._ends.values():
            while not end.is_acknowledged() and time.monotonic() < until:
                pass
        self._ends.clear()
        self._participant.close()

    def _receive(self, name: str, _: str, content: bytes) -> None:
        """Accept a request; called in the subscription's thread."""
        found = split_request(content)
        if found is None:
            return  # without a client id no answer is possible
        header, message = found
        kind = self._kinds[name]
        try:
            fields = types_of(2).decode(f"{kind}_Request", message)
        except FieldsError:
            self._write(name, header, self._refuse(f"the request cannot be read as one of {kind}"))
            return
        self._accept(ServiceRequest(name, fields, header))

    def _refuse_now(self, request: ServiceRequest, why: str) -> None:
        self._write(request.name, request.client, self._refuse(why))

    def _write(self, name: str, header: bytes, fields: Fields) -> None:
        kind = self._kinds[name]
        content = types_of(2).encode(f"{kind}_Response", known_fields(kind, fields))
        self._ends[name].write(with_header(content, header))


def with_header(content: bytes, header: bytes) -> bytes:
    """Return the bytes of a request or an answer with the header that identifies the request."""
    return content[:_ENCAPSULATION] + header + content[_ENCAPSULATION:]


def split_request(content: bytes) -> tuple[bytes, bytes] | None:
    """Return the header of a request or answer, in little-endian order, and the message; None if the size is wrong."""
    order = _ORDERS.get(content[:2])
    begin, end = _ENCAPSULATION, _ENCAPSULATION + _HEADER
    if order is None or not end <= len(content) <= MESSAGE_BYTES_MAX:
        return None
    return struct.pack("<Qq", *struct.unpack(f"{order}Qq", content[begin:end])), content[:begin] + content[end:]
