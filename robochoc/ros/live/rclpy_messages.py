"""Messages of rclpy: from fields as sinks and sources have them to rclpy's objects, and back. rclpy is untyped.

Its classes check what they are given: a `float64` must be a `float`, and a `byte` is one of `bytes`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.live.rospy_messages import message_class

_NANO = 1_000_000_000
_TIMES = ("builtin_interfaces/Time", "builtin_interfaces/Duration")
_FLOATS = ("double", "float")
_ELEMENT = re.compile(r"(?:sequence<)?([\w/]+(?:<\d+>)?)")
"""The type of an element: of `sequence<double>`, `sequence<geometry_msgs/Pose, 3>`, `float[36]` or `string<10>`."""


def filled(message: Any, fields: Fields) -> Any:  # noqa: ANN401 - messages are untyped
    """Return `message` with these fields. Raises `ValueError` for a field that it does not have."""
    kinds = message.get_fields_and_field_types()
    for name, value in fields.items():
        if name not in kinds:
            raise ValueError(f"{type(message).__name__} has no field {name!r}, only: {', '.join(kinds)}")
        kind = kinds[name]
        if isinstance(value, Mapping):
            filled(getattr(message, name), value)
        elif isinstance(value, list | tuple):
            setattr(message, name, [_converted(_element(kind), one) for one in value])
        else:
            setattr(message, name, _converted(kind, value))
    return message


def _converted(kind: str, value: Any) -> Any:  # noqa: ANN401 - a field is anything
    if kind in _TIMES:
        made = message_class(kind, SinkError, "rclpy")()
        made.sec, made.nanosec = divmod(value, _NANO)
        return made
    if isinstance(value, Mapping):
        return filled(message_class(kind, SinkError, "rclpy")(), value)
    if kind in _FLOATS:
        return float(value)
    return bytes([value & 0xFF]) if kind == "octet" else value


def _element(kind: str) -> str:
    found = _ELEMENT.match(kind)
    return found[1] if found else kind


def fields_of(message: Any) -> dict[str, Any]:  # noqa: ANN401 - messages are untyped
    """Return the fields of a message of rclpy."""
    kinds = message.get_fields_and_field_types()
    return {name: _plain(getattr(message, name), _element(kind)) for name, kind in kinds.items()}


def _plain(value: Any, kind: str) -> Any:  # noqa: ANN401 - a field is anything
    if kind == "octet" and isinstance(value, bytes):
        return int.from_bytes(value, "big", signed=True)
    if kind in _TIMES:
        return int(value.sec) * _NANO + int(value.nanosec)
    if hasattr(value, "get_fields_and_field_types"):
        return fields_of(value)
    if hasattr(value, "tolist"):  # numpy's and Python's arrays
        return value.tolist()
    return [_plain(one, kind) for one in value] if isinstance(value, list | tuple) else value
