"""Services in a ROS 2 network with zenoh as middleware, and the hashes of their types (RIHS01).

A request is a zenoh query. The attachments of request and answer contain the client's id.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Iterable, Mapping
from functools import cache, partial
from types import MappingProxyType
from typing import Any

from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.live.rmw_zenoh import MESSAGE_BYTES_MAX
from robochoc.ros.live.rmw_zenoh_keys import NO_HASH, ZenohTopic
from robochoc.ros.live.rmw_zenoh_session import RosPublisher, RosQuery, RosSession
from robochoc.ros.live.services import ImmediateServices, Refuse, ServiceRequest, Services, known_fields
from robochoc.ros.message_types import FieldsError, FieldType, types_of
from robochoc.ros.waypoint_types import short_kind

_NUMBERS: Mapping[str, int] = MappingProxyType(
    {
        "int8": 2,
        "uint8": 3,
        "int16": 4,
        "uint16": 5,
        "int32": 6,
        "uint32": 7,
        "int64": 8,
        "uint64": 9,
        "float32": 10,
        "float64": 11,
        "char": 13,
        "bool": 15,
        "byte": 16,
        "string": 17,
    }
)
"""The numbers of types in `type_description_interfaces/msg/FieldType`."""
_NESTED, _BOUNDED_STRING = 1, 21
_ARRAY, _BOUNDED, _UNBOUNDED = 48, 96, 144
"""The offsets added to a type's number for an array, a bounded sequence and an unbounded sequence."""
_TIME, _INFO = "builtin_interfaces/msg/Time", "service_msgs/msg/ServiceEventInfo"
_INFO_FIELDS = (
    ("event_type", FieldType("uint8")),
    ("stamp", FieldType("builtin_interfaces/Time")),
    ("client_gid", FieldType("uint8", 0, "array", 16)),
    ("sequence_number", FieldType("int64")),
)
_TIME_FIELDS = (("sec", FieldType("int32")), ("nanosec", FieldType("uint32")))


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
                named = ZenohTopic.for_service(name, kind, NO_HASH if self._is_humble else service_hash(kind))
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
        type_hash = NO_HASH if self._is_humble else types_of(2).type_hash(kind)
        self._publishers[topic] = self._session.publisher(ZenohTopic.for_topic(topic, kind, type_hash))

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


@cache
def service_hash(kind: str) -> str:
    """Return the hash of the service type `kind`, such as `std_srvs/Trigger`, whose fields must all be primitive.

    ROS 2 compares the definitions of services by this hash (REP 2016, the packages rosidl_generator_type_description
    and service_msgs). A service is a type with three fields: its request, its response, and its event for service
    introspection. The hash is the SHA-256 of the descriptions of these types in canonical JSON.

    Raises:
        UnknownTypeError: The type of the request or of the response is unknown.
        ValueError: A field is not primitive.
    """
    name = short_kind(kind).replace("/", "/srv/", 1)
    halves = {f"{name}_{half}": types_of(2).layout(f"{kind}_{half}") for half in ("Request", "Response")}
    event = f"{name}_Event"
    described = [
        *(_described(half, (_field(*field) for field in fields)) for half, fields in halves.items()),
        _described(event, _event_fields(*halves)),
        _described(_INFO, (_field(*field) for field in _INFO_FIELDS)),
        _described(_TIME, (_field(*field) for field in _TIME_FIELDS)),
    ]
    parts = zip(("request_message", "response_message", "event_message"), (*halves, event), strict=True)
    description = {
        "type_description": _described(name, (_named(part, _NESTED, nested=one) for part, one in parts)),
        "referenced_type_descriptions": sorted(described, key=lambda one: str(one["type_name"])),
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(description).encode()).hexdigest()}"


def _event_fields(request: str, response: str) -> Iterable[dict[str, Any]]:
    yield _named("info", _NESTED, nested=_INFO)
    for field, half in (("request", request), ("response", response)):
        yield _named(field, _NESTED + _BOUNDED, capacity=1, nested=half)


def _described(name: str, fields: Iterable[dict[str, Any]]) -> dict[str, Any]:
    return {"type_name": name, "fields": [*fields]}


def _field(name: str, kind: FieldType) -> dict[str, Any]:
    if kind.name == "builtin_interfaces/Time":
        return _named(name, _NESTED, nested=_TIME)
    if kind.name not in _NUMBERS:
        raise ValueError(f"{name} has the type {kind.name}: fields of services must be primitive")
    number = _BOUNDED_STRING if kind.limit else _NUMBERS[kind.name]
    shape = {"one": 0, "array": _ARRAY, "sequence": _BOUNDED if kind.size else _UNBOUNDED}[kind.shape]
    return _named(name, number + shape, capacity=kind.size, characters=kind.limit)


def _named(name: str, number: int, *, capacity: int = 0, characters: int = 0, nested: str = "") -> dict[str, Any]:
    kind = {"type_id": number, "capacity": capacity, "string_capacity": characters, "nested_type_name": nested}
    return {"name": name, "type": kind}
