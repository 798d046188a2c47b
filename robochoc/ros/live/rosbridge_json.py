"""The fields of messages as rosbridge's JSON has them, and back.

Times are sent as `secs` and `nsecs`. The bridges of both versions of ROS accept these; that of ROS 2 sends `sec` and
`nanosec`. So the version need not be known. JSON has no form for NaN: it comes as null, and is sent as `NaN`, which the
parsers of the bridges (Python's) accept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from robochoc.robots.sink import Fields

_DEPTH_MAX = 10
"""Fields are nested no deeper."""
_BILLION = 1_000_000_000
_SECONDS = range(-(2**31), 2**32)


class MalformedMessageError(ValueError):
    """A message from the server does not have the form of one."""


def outgoing(fields: Fields) -> dict[str, Any]:
    """Return `fields` in the form that rosbridge takes."""
    return {name: _sent(name, value) for name, value in fields.items()}


def _sent(name: str, value: object) -> object:
    match value:
        case Mapping():
            return outgoing(value)
        case list() | tuple():
            return [_sent("", one) for one in value]
        case int() if name == "stamp":
            seconds, rest = divmod(value, _BILLION)
            return {"secs": seconds, "nsecs": rest}
        case _:
            return value


def incoming(message: object) -> tuple[dict[str, Any], int]:
    """Return the fields of a `message` from rosbridge, and their weight: how many characters and fields it has.

    Raises:
        MalformedMessageError: `message` is no object, is nested too deeply, or has a time that is none.
    """
    if not isinstance(message, dict):
        raise MalformedMessageError("no object")
    return _object(message, 0)


def _object(message: dict[str, Any], depth: int) -> tuple[dict[str, Any], int]:
    if depth > _DEPTH_MAX:
        raise MalformedMessageError(f"nested more than {_DEPTH_MAX} deep")
    fields: dict[str, Any] = {}
    weight = 1
    for name, value in message.items():
        fields[name], more = (_stamp(value), 1) if name == "stamp" else _received(value, depth + 1)
        weight += len(name) + more
    return fields, weight


def _received(value: object, depth: int) -> tuple[Any, int]:
    match value:
        case dict():
            return _object(value, depth)
        case list():
            if depth > _DEPTH_MAX:
                raise MalformedMessageError(f"nested more than {_DEPTH_MAX} deep")
            parts = [_received(one, depth + 1) for one in value]
            return [part for part, _ in parts], 1 + sum(weight for _, weight in parts)
        case str():
            return value, 1 + len(value)
        case None:
            return math.nan, 1
        case _:
            return value, 1


def _stamp(value: object) -> int:
    """Return nanoseconds, of a time with the field names of ROS 1 or of ROS 2."""
    match value:
        case {"secs": int(seconds), "nsecs": int(rest)} | {"sec": int(seconds), "nanosec": int(rest)} if (
            seconds in _SECONDS and 0 <= rest < _BILLION
        ):
            return seconds * _BILLION + rest
        case _:
            raise MalformedMessageError("'stamp' is not a time")
