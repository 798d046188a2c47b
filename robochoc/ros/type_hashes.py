"""Hashes of ROS 2 types (RIHS01), by which ROS 2 compares the definitions of messages, services and actions.

A hash is the SHA-256 of a type's description and of the descriptions of all types of its fields, as canonical JSON
(REP 2016, the packages rosidl_generator_type_description and service_msgs).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any

from robochoc.ros.interfaces import full_name
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
"""The offsets added to a type's number for an array, a bounded sequence and an unbounded sequence."""
_INFO = "service_msgs/msg/ServiceEventInfo"
_INFO_FIELDS = (
    ("event_type", FieldType("uint8")),
    ("stamp", FieldType("builtin_interfaces/Time")),
    ("client_gid", FieldType("uint8", 0, "array", 16)),
    ("sequence_number", FieldType("int64")),
)
_TIMES = frozenset({"builtin_interfaces/Time", "builtin_interfaces/Duration"})
_TIME_FIELDS = (("sec", FieldType("int32")), ("nanosec", FieldType("uint32")))

_Description = dict[str, Any]


@cache
def type_hash(kind: str) -> str:
    """Return the hash of the message type `kind`, in either spelling. Raises `UnknownTypeError`."""
    short = short_kind(kind)
    name = full_name(short)
    found = _described_with_fields(short)
    return _hashed(found.pop(name), found.values())


@cache
def service_hash(kind: str) -> str:
    """Return the hash of the service type `kind`, such as `std_srvs/Trigger`.

    A service is a type with three fields: its request, its response, and its event for service introspection.

    Raises:
        UnknownTypeError: The type of the request or of the response is unknown.
    """
    name = full_name(short_kind(kind))
    request, response, event = (f"{name}_{part}" for part in ("Request", "Response", "Event"))
    found = {
        **_described_with_fields(f"{kind}_Request"),
        **_described_with_fields(f"{kind}_Response"),
        **_described_with_fields("builtin_interfaces/Time"),
        _INFO: _description(_INFO, (_field(*field) for field in _INFO_FIELDS)),
        event: _description(
            event,
            [
                _named("info", _NESTED, nested=_INFO),
                _named("request", _NESTED + _BOUNDED, capacity=1, nested=request),
                _named("response", _NESTED + _BOUNDED, capacity=1, nested=response),
            ],
        ),
    }
    parts = {"request_message": request, "response_message": response, "event_message": event}
    service = _description(name, (_named(part, _NESTED, nested=nested) for part, nested in parts.items()))
    return _hashed(service, found.values())


def _hashed(described: _Description, referenced: Iterable[_Description]) -> str:
    description = {
        "type_description": described,
        "referenced_type_descriptions": sorted(referenced, key=lambda one: str(one["type_name"])),
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(description).encode()).hexdigest()}"


def _described_with_fields(kind: str) -> dict[str, _Description]:
    """Return the descriptions of `kind` and of the types of its fields, by full name. Raises `UnknownTypeError`."""
    found: dict[str, _Description] = {}
    waiting = [kind]
    while waiting:
        one = waiting.pop()
        name = full_name(one)
        if name not in found:
            layout = _layout(one)
            found[name] = _description(name, (_field(*field) for field in layout))
            waiting += [field.name for _, field in layout if "/" in field.name]
    return found


def _layout(kind: str) -> Sequence[tuple[str, FieldType]]:
    return _TIME_FIELDS if kind in _TIMES else types_of(2).layout(kind)


def _description(name: str, fields: Iterable[dict[str, Any]]) -> _Description:
    return {"type_name": name, "fields": [*fields]}


def _field(name: str, kind: FieldType) -> dict[str, Any]:
    if "/" in kind.name:
        number, nested = _NESTED, full_name(kind.name)
    else:
        number, nested = _BOUNDED_STRING if kind.limit else _NUMBERS[kind.name], ""
    shape = {"one": 0, "array": _ARRAY, "sequence": _BOUNDED if kind.size else _UNBOUNDED}[kind.shape]
    return _named(name, number + shape, capacity=kind.size, characters=kind.limit, nested=nested)


def _named(name: str, number: int, *, capacity: int = 0, characters: int = 0, nested: str = "") -> dict[str, Any]:
    kind = {"type_id": number, "capacity": capacity, "string_capacity": characters, "nested_type_name": nested}
    return {"name": name, "type": kind}
