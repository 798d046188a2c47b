"""DDS types for ROS types. Messages are encoded by `message_types.py`; DDS only transports their bytes.

ROS 2 publishes `/a/b` on the DDS topic `rt/a/b`, and `geometry_msgs/PoseStamped` as the DDS type
`geometry_msgs::msg::dds_::PoseStamped_`. Tools such as `cyclonedds subscribe` request the description of a type, in
which fields have their ROS names.
"""

from __future__ import annotations

from functools import cache
from typing import Any, Protocol, assert_never, cast

from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl_types

from robochoc.ros.live.ros2_names import dds_type_name
from robochoc.ros.message_types import FieldType, types_of
from robochoc.ros.waypoint_types import short_kind

_idl: Any = idl_types
"""The module, untyped since mypy does not accept its generic types."""
_SCALARS: dict[str, Any] = {
    "bool": bool,
    "byte": _idl.byte,
    "char": _idl.uint8,  # as in ROS 2
    **{f"float{bits}": getattr(_idl, f"float{bits}") for bits in (32, 64)},
    **{f"{sign}int{bits}": getattr(_idl, f"{sign}int{bits}") for sign in ("", "u") for bits in (8, 16, 32, 64)},
}
_BOUND_MAX = 65_535
"""The largest bound of a sequence in DDS. Sequences with larger bounds are described as unbounded."""


class RawMessage(Protocol):
    """A message as sent over DDS: its bytes in CDR, with the four-byte header."""

    content: bytes

    def __init__(self, content: bytes) -> None: ...


def topic_name(topic: str) -> str:
    """Return the DDS name of a ROS 2 topic."""
    return f"rt{topic}"


@cache
def raw_type(kind: str) -> type[RawMessage]:
    """Return the DDS type of `kind`, whose messages are left as bytes. Raises `UnknownTypeError`.

    The library creates the type; its conversion to and from objects is replaced.
    """
    return _raw(_new_struct(short_kind(kind)))


@cache
def raw_service_type(kind: str) -> type[RawMessage]:
    """Return the DDS type of one half of a service, such as `std_srvs/Trigger_Request`. Raises `UnknownTypeError`.

    In the middleware for Cyclone DDS, the first fields identify the request.
    """
    name = dds_type_name(kind)
    header = {"client_guid": _SCALARS["uint64"], "sequence_number": _SCALARS["int64"]}
    fields = {field: _field(what) for field, what in types_of(2).layout(kind)}
    return _raw(make_idl_struct(name.rpartition("::")[2], name, {**header, **fields}, dataclassify=True))


def _raw(made: Any) -> type[RawMessage]:  # noqa: ANN401 - a class created at run time
    """Replace the conversions of a type, so that its messages are left as bytes."""

    def init(self: Any, content: bytes) -> None:  # noqa: ANN401
        self.content = content

    def serialize(self: Any, *_: object, **__: object) -> bytes:  # noqa: ANN401
        return cast("bytes", self.content)

    def deserialize(content: bytes, *_: object, **__: object) -> Any:  # noqa: ANN401
        return made(content)

    for name, method in {"__init__": init, "serialize": serialize, "serialize_key": serialize}.items():
        setattr(made, name, method)
    for name in ("deserialize", "deserialize_key"):
        setattr(made, name, staticmethod(deserialize))
    return cast("type[RawMessage]", made)


@cache
def dds_struct(kind: str) -> Any:  # noqa: ANN401 - a class created at run time
    """Return the DDS description of `kind`, a class from the library. Raises `UnknownTypeError`."""
    return _new_struct(kind)


def _new_struct(kind: str) -> Any:  # noqa: ANN401 - see above
    fields = {name: _field(field) for name, field in types_of(2).layout(kind)}
    name = dds_type_name(kind)
    return make_idl_struct(name.rpartition("::")[2], name, fields, dataclassify=True)


def _field(field: FieldType) -> Any:  # noqa: ANN401 - annotations of the library
    if "/" in field.name:
        one: Any = dds_struct(field.name)
    elif field.name == "string":
        one = _idl.bounded_str[field.limit] if field.limit else str
    else:
        one = _SCALARS[field.name]
    match field.shape:
        case "one":
            return one
        case "array":
            return _idl.array[one, field.size]
        case "sequence":
            return _idl.sequence[one, field.size] if 0 < field.size <= _BOUND_MAX else _idl.sequence[one]
        case never:
            assert_never(never)
