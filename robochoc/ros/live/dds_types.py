"""DDS types of ROS types. The bytes of messages are those of `message_types.py`: DDS only carries them.

ROS 2 publishes `/a/b` on the DDS topic `rt/a/b`, and `geometry_msgs/PoseStamped` as the DDS type
`geometry_msgs::msg::dds_::PoseStamped_`. The description of a type is for those that ask for it, such as
`cyclonedds subscribe`: its fields have the names that they have in ROS.
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
"""Its generic types are none to mypy."""
_SCALARS: dict[str, Any] = {
    "bool": bool,
    "byte": _idl.byte,
    "char": _idl.uint8,  # as ROS 2 has it
    **{f"float{bits}": getattr(_idl, f"float{bits}") for bits in (32, 64)},
    **{f"{sign}int{bits}": getattr(_idl, f"{sign}int{bits}") for sign in ("", "u") for bits in (8, 16, 32, 64)},
}
_BOUND_MAX = 65_535
"""A greater bound of a sequence cannot be described; the sequence is described without one."""


class RawMessage(Protocol):
    """A message of a DDS type as it travels: its bytes in CDR, with the header of four bytes."""

    content: bytes

    def __init__(self, content: bytes) -> None: ...


def topic_name(topic: str) -> str:
    """Return the name in DDS of a topic of ROS 2."""
    return f"rt{topic}"


@cache
def raw_type(kind: str) -> type[RawMessage]:
    """Return the DDS type of `kind`, whose messages stay bytes. Raises `UnknownTypeError`.

    It is the library's own way to a type, with the conversion to and from objects replaced.
    """
    return _raw(_described(short_kind(kind)))


@cache
def raw_service_type(kind: str) -> type[RawMessage]:
    """Return the DDS type of one half of a service, such as `std_srvs/Trigger_Request`. Raises `UnknownTypeError`.

    Before its fields are those by which Cyclone DDS's middleware tells requests apart.
    """
    name = dds_type_name(kind).replace("::msg::", "::srv::")
    header = {"client_guid": _SCALARS["uint64"], "sequence_number": _SCALARS["int64"]}
    fields = {field: _field(what) for field, what in types_of(2).layout(kind)}
    return _raw(make_idl_struct(name.rpartition("::")[2], name, {**header, **fields}, dataclassify=True))


def _raw(made: Any) -> type[RawMessage]:  # noqa: ANN401 - a class that was made here
    """Return a described type whose messages stay bytes."""

    def keep(self: Any, content: bytes) -> None:  # noqa: ANN401 - made above
        self.content = content

    def written(self: Any, *_: object, **__: object) -> bytes:  # noqa: ANN401 - made above
        return cast("bytes", self.content)

    def read(content: bytes, *_: object, **__: object) -> Any:  # noqa: ANN401 - made above
        return made(content)

    for name, method in {"__init__": keep, "serialize": written, "serialize_key": written}.items():
        setattr(made, name, method)
    for name in ("deserialize", "deserialize_key"):
        setattr(made, name, staticmethod(read))
    return cast("type[RawMessage]", made)


@cache
def described(kind: str) -> Any:  # noqa: ANN401 - a class that is made here
    """Return the description of `kind` as DDS has it: a class of the library. Raises `UnknownTypeError`."""
    return _described(kind)


def _described(kind: str) -> Any:  # noqa: ANN401 - see above
    fields = {name: _field(field) for name, field in types_of(2).layout(kind)}
    name = dds_type_name(kind)
    return make_idl_struct(name.rpartition("::")[2], name, fields, dataclassify=True)


def _field(field: FieldType) -> Any:  # noqa: ANN401 - annotations of the library
    if "/" in field.name:
        one: Any = described(field.name)
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
