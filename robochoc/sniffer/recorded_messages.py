"""Recorded messages: finds the protocols of a trace's runs, and rebuilds message objects from recorded fields."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import Any, cast, get_args

import msgspec
from msgspec.inspect import (
    AnyType,
    CollectionType,
    DictType,
    FloatType,
    NoneType,
    StructType,
    TupleType,
    Type,
    UnionType,
    type_info,
)

from robochoc.protocols.acts import INFORM, Act
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.run.registry import UnknownProtocolError, protocol_by_class, protocol_or_stage
from robochoc.sniffer.trace import Trace

_LISTS = (CollectionType, TupleType, StructType)


class RunProtocols:
    """The installed protocols for the runs in `trace`."""

    def __init__(self, trace: Trace) -> None:
        self._trace = trace
        self._found: dict[int, tuple[str, type[Protocol]] | None] = {}
        self._types: dict[int, Mapping[str, type[Message]]] = {}

    def of_run(self, run: int) -> tuple[str, type[Protocol]] | None:
        """Return the name and class of a run's protocol, or None if it is not installed."""
        if run not in self._found:
            self._found[run] = installed_protocol(self._trace.runs[run].protocol, self._trace.header.protocol)
        return self._found[run]

    def message_types(self, run: int) -> Mapping[str, type[Message]]:
        """Return the message types of a run's protocol by name; empty if it is not installed."""
        if run not in self._types:
            found = self.of_run(run)
            self._types[run] = types_by_name(found[1]) if found else {}
        return self._types[run]

    def type_of(self, message: int) -> type[Message] | None:
        """Return the class of the message with this number, or None if it is unknown."""
        columns = self._trace.messages
        return self.message_types(columns.run[message]).get(self._trace.kinds[columns.kind[message]])

    def act_of(self, message: int) -> Act:
        """Return the FIPA act of the message with this number."""
        kind = self.type_of(message)
        return kind.act if kind else INFORM

    def act_of_type(self, name: str) -> Act:
        """Return the FIPA act of the message type `name`, in the first run whose protocol has this type."""
        for run in range(len(self._trace.runs)):
            kind = self.message_types(run).get(name)
            if kind is not None:
                return kind.act
        return INFORM


def message_types(protocol: type[Protocol]) -> tuple[type[Message], ...]:
    """Return the types of all messages of a protocol."""
    return get_args(protocol.messages) or (protocol.messages,)


def message_of(kind: type[Message], content: Mapping[str, Any]) -> Message | None:
    """Return a message of type `kind` with these recorded fields, or None if they do not fit the type.

    In its text form, a journal contains bytes in base64, and null for infinite numbers; both are restored.
    """
    try:
        info = _declared(kind)
        values = {field.name: _with_infinity(content[field.name], field.type) for field in info.fields}
        fields: Any = [info.tag, *values.values()] if info.array_like else {info.tag_field: info.tag, **values}
        return msgspec.convert(fields, kind, str_keys=True)
    except (msgspec.MsgspecError, LookupError, TypeError, ValueError, OverflowError, RecursionError):
        return None


@cache
def _declared(kind: type[Message]) -> StructType:
    return cast("StructType", type_info(kind))


def types_by_name(protocol: type[Protocol]) -> Mapping[str, type[Message]]:
    """Return the types of all messages of a protocol, by their names in journals."""
    return {kind.__name__: kind for kind in message_types(protocol)}


def installed_protocol(name: str, asked: str) -> tuple[str, type[Protocol]] | None:
    """Return the name and class of a run's protocol, or None if it is not installed.

    Args:
        name: The protocol's class, as recorded at the start of the run, or its name if the start was not recorded.
        asked: The name of the requested protocol in the journal's header.
    """
    if name == asked:
        with suppress(UnknownProtocolError):
            return name, protocol_or_stage(name)
    return protocol_by_class(name, [asked])


def _with_infinity(value: Any, declared: Type) -> Any:  # noqa: ANN401 - fields are of any type
    """Return `value` with None replaced by `inf` where the declared type is a number that cannot be None."""
    if value is None:
        return math.inf if _is_number(declared) else None
    if isinstance(value, dict):
        kind = declared.value_type if isinstance(declared, DictType) else AnyType()
        return {key: _with_infinity(one, kind) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_with_infinity(one, kind) for one, kind in zip(value, _items(declared, len(value)), strict=True)]
    return value


def _is_number(declared: Type) -> bool:
    kinds = declared.types if isinstance(declared, UnionType) else (declared,)
    return any(isinstance(kind, FloatType) for kind in kinds) and not any(isinstance(kind, NoneType) for kind in kinds)


def _items(declared: Type, count: int) -> Sequence[Type]:
    """Return the declared types of the `count` items in a list."""
    match declared:
        case UnionType(types):
            return _items(next((kind for kind in types if isinstance(kind, _LISTS)), AnyType()), count)
        case TupleType(types) if len(types) == count:
            return types
        case StructType(fields=fields) if len(fields) == count:
            return [field.type for field in fields]
        case CollectionType(item):
            return [item] * count
        case _:
            return [AnyType()] * count
