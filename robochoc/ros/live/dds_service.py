"""Services of ROS 2 in DDS, in the form that Cyclone DDS's middleware (rmw_cyclonedds_cpp) has.

A request travels on `rq/NAMERequest`, its answer on `rr/NAMEReply`. Before the fields of both there are 16 bytes: who
asks, and the number of the request. The answer repeats them, so that clients know theirs. Requests come from outside:
each that can be told from others is answered, also one whose fields cannot be read.
"""

from __future__ import annotations

import queue
import struct
import time
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple, Self

from robochoc.ros.live.dds_participant import MESSAGE_BYTES_MAX, Participant, ServiceEnd
from robochoc.ros.live.dds_place import DdsPlace, Quality
from robochoc.ros.recordings.types import FieldsError, types_of
from robochoc.ros.sink import Fields, SinkError

WAITING_MAX = 16
"""Requests that wait for their turn. Others are refused at once."""
MATCH_S = 1.0
"""The longest wait for the client's reader of answers, in seconds: it may be found after its request has come."""
END_S = 2.0
"""The longest wait for clients to acknowledge the last answers, in seconds."""
_HEADER = 16
_ENCAPSULATION = 4
_ORDERS = {b"\0\0": ">", b"\0\1": "<"}

Refuse = Callable[[str], Fields]


class Request(NamedTuple):
    """A request to the service `name`: its fields, and the 16 bytes by which its client knows the answer."""

    name: str
    fields: Fields
    header: bytes


class DdsServices:
    """Offers services, by their names, in a domain of DDS. Raises `SinkError`, as its methods do.

    Args:
        place: As for the sink `dds`; only the domain and partitions may be given.
        services: The type of each service, such as `std_srvs/Trigger`.
        refuse: Makes the fields of an answer that refuses, for a reason in words.
    """

    lacking: Collection[str] = ()
    """Services that are not offered: none."""

    def __init__(self, place: str, services: Mapping[str, str], refuse: Refuse) -> None:
        found = DdsPlace.of(place, Quality(reliable=True, latched=False, depth=WAITING_MAX), ("partition",), SinkError)
        self.domain = found.domain
        self.where = f"domain {found.domain} of DDS"
        self._kinds = {**services}
        self._refuse = refuse
        self._waiting: queue.Queue[Request] = queue.Queue(WAITING_MAX)
        self._ends: dict[str, ServiceEnd] = {}
        self._participant = Participant(found, SinkError)
        try:
            for name, kind in services.items():
                self._ends[name] = self._participant.serve(name, kind)
            for end in self._ends.values():
                end.listen(self._receive)
        except BaseException:
            self.close()
            raise

    def next(self, wait_s: float) -> Request | None:
        """Return the oldest request that waits, or that comes within `wait_s`; None if none does."""
        try:
            return self._waiting.get(timeout=wait_s)
        except queue.Empty:
            return None

    def reply(self, request: Request, fields: Fields) -> None:
        """Answer `request`."""
        end = self._ends[request.name]
        until = time.monotonic() + MATCH_S
        while not end.has_clients() and time.monotonic() < until:
            time.sleep(0.01)
        self._write(request.name, request.header, fields)

    def close(self) -> None:
        """Refuse what still waits, and leave the domain."""
        for end in self._ends.values():
            end.stop()
        while (request := self._left()) is not None:
            self._write(request.name, request.header, self._refuse("the service has ended"))
        until = time.monotonic() + END_S
        for end in self._ends.values():
            while not end.is_acknowledged() and time.monotonic() < until:
                pass
        self._ends.clear()
        self._participant.close()

    def _left(self) -> Request | None:
        try:
            return self._waiting.get_nowait()
        except queue.Empty:
            return None

    def _receive(self, name: str, _: str, content: bytes) -> None:
        """Take a request, in the subscription's thread."""
        order = _ORDERS.get(content[:2])
        if order is None or not _ENCAPSULATION + _HEADER <= len(content) <= MESSAGE_BYTES_MAX:
            return  # nobody can be answered
        begin, end = _ENCAPSULATION, _ENCAPSULATION + _HEADER
        header = struct.pack("<Qq", *struct.unpack(f"{order}Qq", content[begin:end]))
        kind = self._kinds[name]
        try:
            fields = types_of(2).decode(f"{kind}_Request", content[:begin] + content[end:])
        except FieldsError:
            self._write(name, header, self._refuse(f"the request cannot be read as one of {kind}"))
            return
        try:
            self._waiting.put_nowait(Request(name, fields, header))
        except queue.Full:
            self._write(name, header, self._refuse(f"{WAITING_MAX} requests wait already; ask again later"))

    def _write(self, name: str, header: bytes, fields: Fields) -> None:
        known: Any = {field for field, _ in types_of(2).layout(f"{self._kinds[name]}_Response")}
        told = {field: value for field, value in fields.items() if field in known}
        content = types_of(2).encode(f"{self._kinds[name]}_Response", told)
        self._ends[name].write(content[:_ENCAPSULATION] + header + content[_ENCAPSULATION:])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
