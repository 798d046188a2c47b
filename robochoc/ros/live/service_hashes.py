"""The hash by which ROS 2 compares the definitions of services (RIHS01).

REP 2016 and the packages rosidl_generator_type_description and service_msgs: a service is a type with three fields, its
request, its response, and the event by which a service can be introspected. Their descriptions are written as JSON in
one way only; the hash is SHA-256 of that.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from robochoc.ros.message_types import FieldType, types_of
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
"""Numbers added to that of a type for an array, and for a sequence with and without a limit."""
_TIME, _INFO = "builtin_interfaces/msg/Time", "service_msgs/msg/ServiceEventInfo"
_INFO_FIELDS = (
    ("event_type", FieldType("uint8")),
    ("stamp", FieldType("builtin_interfaces/Time")),
    ("client_gid", FieldType("uint8", 0, "array", 16)),
    ("sequence_number", FieldType("int64")),
)
_TIME_FIELDS = (("sec", FieldType("int32")), ("nanosec", FieldType("uint32")))


@cache
def service_hash(kind: str) -> str:
    """Return the hash of the service type `kind`, such as `std_srvs/Trigger`, all of whose fields are primitive.

    Raises:
        UnknownTypeError: One of its halves is not known.
        ValueError: It has a field of a type of its own.
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
    whole = {
        "type_description": _described(name, (_named(part, _NESTED, nested=one) for part, one in parts)),
        "referenced_type_descriptions": sorted(described, key=lambda one: str(one["type_name"])),
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(whole).encode()).hexdigest()}"


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
        raise ValueError(f"{name} is a {kind.name}: only primitive fields are known for services")
    number = _BOUNDED_STRING if kind.limit else _NUMBERS[kind.name]
    shape = {"one": 0, "array": _ARRAY, "sequence": _BOUNDED if kind.size else _UNBOUNDED}[kind.shape]
    return _named(name, number + shape, capacity=kind.size, characters=kind.limit)


def _named(name: str, number: int, *, capacity: int = 0, characters: int = 0, nested: str = "") -> dict[str, Any]:
    kind = {"type_id": number, "capacity": capacity, "string_capacity": characters, "nested_type_name": nested}
    return {"name": name, "type": kind}
