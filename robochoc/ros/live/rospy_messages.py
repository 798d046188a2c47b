"""Messages of rospy: their classes, and their fields as sinks and sources have them. rospy is untyped."""

from __future__ import annotations

import importlib
import re
from collections.abc import Mapping
from types import ModuleType
from typing import Any

from robochoc.formats.diagnostics import shortened
from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.live.ros_master import Failed

_NANO = 1_000_000_000
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/([A-Za-z][A-Za-z0-9_]*)")


def message_class(kind: str, failed: Failed, library: str = "rospy") -> Any:  # noqa: ANN401 - messages are untyped
    """Return `library`'s class of the ROS type `kind`, also in ROS 2's spelling with `/msg/`. Raises `failed`."""
    found = _TYPE.fullmatch(kind.replace("/msg/", "/"))
    try:
        package: ModuleType = importlib.import_module(f"{found[1]}.msg" if found else "")
        return getattr(package, found[2] if found else "")
    except (ImportError, AttributeError, ValueError) as missing:
        where = f"install the package {found[1]!r} for Python" if found else "expected PACKAGE/TYPE"
        raise failed(f"{library} knows no message type {shortened(kind)!r}; {where}") from missing


def filled(message: Any, fields: Fields) -> Any:  # noqa: ANN401 - messages are untyped
    """Return `message` with these fields. Raises `ValueError` for a field that it does not have."""
    for name, value in fields.items():
        if name not in message.__slots__:
            raise ValueError(f"{message._type} has no field {name!r}, only: {', '.join(message.__slots__)}")  # noqa: SLF001
        now = getattr(message, name)
        match value:
            case Mapping():
                filled(now, value)
            case int() if hasattr(now, "nsecs"):
                now.secs, now.nsecs = divmod(value, _NANO)
            case list() | tuple() if value and isinstance(value[0], Mapping):
                setattr(message, name, [filled(_element(message, name), one) for one in value])
            case _:
                setattr(message, name, value)
    return message


def _element(message: Any, name: str) -> Any:  # noqa: ANN401 - messages are untyped
    """Return a new element of an array field."""
    kind = message._slot_types[message.__slots__.index(name)]  # noqa: SLF001 - genpy's way to say it
    return message_class(kind.partition("[")[0], SinkError)()


def fields_of(message: Any) -> dict[str, Any]:  # noqa: ANN401 - messages are untyped
    """Return the fields of a rospy message, without `seq`: ROS 1 counts it by itself, ROS 2 has none."""
    return {name: _plain(getattr(message, name)) for name in message.__slots__ if name != "seq"}


def _plain(value: Any) -> Any:  # noqa: ANN401 - a field is anything
    if hasattr(value, "nsecs"):
        return value.to_nsec()
    if hasattr(value, "_slot_types"):
        return fields_of(value)
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value
