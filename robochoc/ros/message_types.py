"""ROS types: encodes the fields of messages in ROS 1 and ROS 2, and decodes their bytes.

Only this module uses `rosbags.typesys`. It supports the types of ROS 1 Noetic, of ROS 2 Humble (which later versions
also have), of installed packages (`waypoint_types.py`), and of services and actions (`interfaces.py`). Definitions in
recordings are untrusted: they are compared with ours line by line, and never parsed by rosbags, which generates and
runs code.
"""

from __future__ import annotations

import math
import operator
import re
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from numbers import Real
from typing import Any, Literal, NamedTuple, cast

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from robochoc.robots.sink import Fields
from robochoc.ros.interfaces import part_definition
from robochoc.ros.rmf.definitions import RMF_TYPES
from robochoc.ros.waypoint_types import definition_of, short_kind
from robochoc.system.errors import RobochocError

DEFINITION_MAX = 1 << 15
"""The maximum number of characters in a definition in a recording. Known definitions have up to about 5,000."""
_LINE = re.compile(r"([A-Za-z][\w/]*)((?:<=\d+)?(?:\[[<=\d]*\])?)\s+([A-Za-z]\w*)\s*(=?)", re.ASCII)
_SECTION = re.compile(r"MSG:\s*([\w/]+)\s*", re.ASCII)
_PRIMITIVE = re.compile(r"bool|byte|char|u?int(?:8|16|32|64)|float(?:32|64)|w?string|time|duration")
_WELL_KNOWN = {"builtin_interfaces/Time", "builtin_interfaces/Duration"}
"""Types that some recorders do not define."""
_SECOND_NS = 10**9
_LARGEST_SINGLE = 3.4028235677973366e38
_TIMES = {"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"}
_HEADER = "std_msgs/msg/Header"
_INTEGERS = {
    **{f"int{bits}": (-(1 << bits - 1), (1 << bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, (1 << bits) - 1) for bits in (8, 16, 32, 64)},
    "char": (0, 255),
    "byte": (-128, 127),
}
_DAMAGE = (SerdeError, struct.error, ValueError, IndexError, OverflowError)


Field = tuple[str, str]
"""The type and the name of a field."""
Version = Literal[1, 2]
"""ROS 1 or ROS 2."""
Converter = Callable[[Any], Any]


class UnknownTypeError(RobochocError, LookupError):
    """The ROS type has no definition, or the definition in an installed package is invalid."""


class FieldsError(RobochocError, ValueError):
    """The fields do not match the type, or the bytes are not a message of the type. The message gives the reason."""


class Definition(NamedTuple):
    """The definition of a type, including the types of its fields, and its MD5 sum as in ROS 1."""

    text: str
    md5: str


class FieldType(NamedTuple):
    """The type of a field: one value (`float64`, `string`, `geometry_msgs/Point`), or an array or a sequence."""

    name: str
    limit: int = 0
    """The maximum number of characters in a string; 0: unlimited."""
    shape: Literal["one", "array", "sequence"] = "one"
    size: int = 0
    """The number of values in an array, or the maximum number in a sequence; 0: unlimited."""


class _Conversion(NamedTuple):
    """The conversions for a type from fields to the library's object and back, and the type's default object."""

    make: Converter
    fields: Converter
    empty: Any


class _FieldError(RobochocError):
    """The value of a field is invalid. `path` has the names of the nested fields that lead to it, innermost first."""

    def __init__(self, why: str, *path: str) -> None:
        super().__init__(why)
        self.path = [*path]


class Types:
    """The types in a version of ROS, named `geometry_msgs/PoseStamped` or `geometry_msgs/msg/PoseStamped`."""

    def __init__(self, version: Version) -> None:
        self.version = version
        self._store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        self._kinds: dict[str, _Conversion] = {}
        self._known: dict[str, _Conversion] = {}
        self._definitions: dict[str, Definition] = {}

    def definition(self, kind: str) -> Definition:
        """Return the definition of `kind` for a recording. Raises `UnknownTypeError`."""
        name = self._name(kind)
        if name not in self._definitions:
            text, md5 = self._store.generate_msgdef(name, ros_version=self.version)
            self._definitions[name] = Definition(text, md5)
        return self._definitions[name]

    def has_same_fields(self, kind: str, text: str) -> bool:
        """Return whether `text` defines the same fields as `kind`. Raises `UnknownTypeError`."""
        return same_fields(short_kind(kind), text, self.definition(kind).text)

    def layout(self, kind: str) -> tuple[tuple[str, FieldType], ...]:
        """Return the fields of `kind` and their types, in order. Raises `UnknownTypeError`."""
        name = self._name(kind)
        self._conversion(kind, name)  # raises `UnknownTypeError` for undefined types of fields
        return tuple((field, _field_type(desc)) for field, desc in self._store.fielddefs[name][1])

    def encode(self, kind: str, fields: Fields) -> bytes:
        """Return the bytes of a message, in CDR for ROS 2, or the format of ROS 1.

        Raises:
            UnknownTypeError: `kind` is unknown.
            FieldsError: `fields` do not match `kind`.
        """
        name = self._name(kind)
        try:
            message = self._conversion(kind, name).make(fields)
        except _FieldError as error:
            where = ".".join(reversed(error.path)) or "it"
            raise FieldsError(f"{short_kind(kind)}: {where} {error}") from None
        store = self._store
        return bytes(store.serialize_ros1(message, name) if self.version == 1 else store.serialize_cdr(message, name))

    def decode(self, kind: str, content: bytes) -> dict[str, Any]:
        """Return the fields of a message from its bytes, which are untrusted.

        Raises:
            UnknownTypeError: `kind` is unknown.
            FieldsError: `content` is not a message of `kind`.
        """
        name = self._name(kind)
        made = self._conversion(kind, name)
        read = self._store.deserialize_ros1 if self.version == 1 else self._store.deserialize_cdr
        try:
            return cast("dict[str, Any]", made.fields(read(content, name)))
        except _DAMAGE as error:
            raise FieldsError(f"{len(content)} bytes are not a {short_kind(kind)}: {error}") from error

    def _name(self, kind: str) -> str:
        """Return the library's name, `geometry_msgs/msg/PoseStamped`; register a package's definition if necessary."""
        short = short_kind(kind)
        name = short.replace("/", "/msg/", 1)
        if name not in self._store.fielddefs:
            text = part_definition(short) or RMF_TYPES.get(short) or definition_of(kind)
            if not text:
                problem = f"ROS {self.version} has no type {kind!r}"
                raise UnknownTypeError(f"{problem}; add its definition to its mapping (documentation, page ROS)")
            try:
                new = get_types_from_msg(text, name)
                self._store.register({each: what for each, what in new.items() if each not in self._store.fielddefs})
            except TypesysError as error:
                raise UnknownTypeError(f"the definition of {kind!r} in its package is invalid: {error}") from error
        return name

    def _conversion(self, kind: str, name: str) -> _Conversion:
        if kind not in self._known:
            try:
                self._known[kind] = self._kind(name)
            except (KeyError, RecursionError) as error:
                raise UnknownTypeError(f"the definition of {kind!r} requires undefined types: {error}") from error
        return self._known[kind]

    def _kind(self, name: str) -> _Conversion:
        if name not in self._kinds:
            self._kinds[name] = self._time(name) if name in _TIMES else self._struct(name)
        return self._kinds[name]

    def _time(self, name: str) -> _Conversion:
        made = self._store.types[name]
        unsigned = self.version == 1 and name.endswith("Time")
        low = 0 if unsigned else -(1 << 31)

        def make(value: object) -> object:
            time_ns = _integer(value)
            if not low <= time_ns // _SECOND_NS < 1 << 31:
                raise _FieldError(f"must be a time of ROS {self.version} in nanoseconds, not {value!r}")
            return made(time_ns // _SECOND_NS, time_ns % _SECOND_NS)

        def nanoseconds(time: Any) -> int:  # noqa: ANN401 - the type of rosbags, which reads signed seconds
            sec = time.sec % (1 << 32) if unsigned else time.sec
            return int(sec) * _SECOND_NS + int(time.nanosec)

        return _Conversion(make, nanoseconds, made(0, 0))

    def _struct(self, name: str) -> _Conversion:
        made = self._store.types[name]
        parts = [(field, self._part(desc)) for field, desc in self._store.fielddefs[name][1]]
        attributes = [*getattr(made, "__dataclass_fields__", ())]  # a field `from` has the attribute `from_`
        hidden = {"seq"} if name == _HEADER else {"structure_needs_at_least_one_member"}
        both = zip(attributes, parts, strict=False)
        shown = [(field, own, part) for own, (field, part) in both if field not in hidden]

        def make(value: object) -> object:
            return made(*_values_of(value, short_kind(name), parts))

        def fields(message: object) -> dict[str, Any]:
            return {field: part.fields(getattr(message, own)) for field, own, part in shown}

        return _Conversion(make, fields, made(*[part.empty for _, part in parts]))

    def _part(self, desc: Any) -> _Conversion:  # noqa: ANN401 - the library's tuples
        what, more = desc
        if what == Nodetype.BASE:
            return _scalar(more[0], more[1])
        if what == Nodetype.NAME:
            return self._kind(more)
        item, number = self._part(more[0]), more[1]
        kind = more[0][1][0] if more[0][0] == Nodetype.BASE and more[0][1][0] != "string" else ""
        fixed = number if what == Nodetype.ARRAY else None

        def make(values: object) -> object:
            if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
                raise _FieldError(f"must be a list, not {values!r}")
            found = [*values]
            if len(found) != fixed if fixed is not None else number and len(found) > number:
                raise _FieldError(
                    f"must have {'' if fixed is not None else 'at most '}{number} values, has {len(found)}"
                )
            return listed([item.make(value) for value in found])

        def listed(values: list[Any]) -> object:
            return np.array(values, _dtype(kind)) if kind else values

        def fields(values: Any) -> list[Any]:  # noqa: ANN401 - an array or a list
            return cast("list[Any]", values.tolist()) if kind else [item.fields(value) for value in values]

        return _Conversion(make, fields, listed([item.empty] * (fixed or 0)))


@cache
def types_of(version: Version) -> Types:
    """Return the types in a version of ROS. The object is created once."""
    return Types(version)


def _field_type(desc: Any) -> FieldType:  # noqa: ANN401 - the library's tuples
    what, more = desc
    if what == Nodetype.BASE:
        return FieldType(more[0], more[1])
    if what == Nodetype.NAME:
        return FieldType(short_kind(more))
    one = _field_type(more[0])
    return one._replace(shape="array" if what == Nodetype.ARRAY else "sequence", size=more[1])


def _values_of(value: object, kind: str, parts: Sequence[tuple[str, _Conversion]]) -> list[Any]:
    """Return the values of all fields of `kind`. Raises `_FieldError`."""
    if not isinstance(value, Mapping):
        raise _FieldError(f"must be fields by their names, not {value!r}")
    names = {field for field, _ in parts}
    if not value.keys() <= names:
        unknown = next(iter(value.keys() - names))
        raise _FieldError(f"is not a field of {kind}, which has {', '.join(sorted(names))}", str(unknown))
    values = []
    for field, part in parts:
        try:
            values.append(part.make(value[field]) if field in value else part.empty)
        except _FieldError as error:
            error.path.append(field)
            raise
    return values


def _dtype(kind: str) -> str:
    return {"bool": "bool_", "char": "uint8", "byte": "int8"}.get(kind, kind)


def _scalar(kind: str, limit: int) -> _Conversion:
    def unchanged(value: object) -> object:
        return value

    if kind == "string":
        return _Conversion(lambda value: _text(value, limit), unchanged, "")
    if kind == "bool":
        return _Conversion(_boolean, unchanged, False)
    if kind.startswith("float"):
        return _Conversion(_float32 if kind == "float32" else _float, unchanged, 0.0)
    low, high = _INTEGERS[kind]

    def make(value: object) -> int:
        integer = _integer(value)
        if not low <= integer <= high:
            raise _FieldError(f"must be a whole number from {low} to {high}, not {value!r}")
        return integer

    return _Conversion(make, unchanged, 0)


def _text(value: object, limit: int) -> str:
    if not isinstance(value, str) or "\0" in value or (limit and len(value) > limit):
        most = f" of at most {limit} characters" if limit else ""
        raise _FieldError(f"must be text{most} without a NUL, not {value!r}")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise _FieldError(f"must be text that UTF-8 can encode, not {value!r}") from None
    return value


def _boolean(value: object) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise _FieldError(f"must be true or false, not {value!r}")
    return bool(value)


def _float(value: object) -> float:
    if type(value) is float:
        return value
    if not isinstance(value, bool) and isinstance(value, Real):
        with suppress(OverflowError):
            return float(value)
    raise _FieldError(f"must be a number, not {value!r}")


def _float32(value: object) -> float:
    number = _float(value)
    if _LARGEST_SINGLE <= abs(number) < math.inf:
        raise _FieldError(f"must be a number of single precision, not {value!r}")
    return number


def _integer(value: object) -> int:
    if not isinstance(value, bool):
        with suppress(TypeError):
            return operator.index(value)  # type: ignore[arg-type]  # raises TypeError for other types
    raise _FieldError(f"must be a whole number, not {value!r}")


def same_fields(kind: str, text: str, ours: str) -> bool:
    """Return whether `text` and `ours` define the same fields for `kind` and its fields' types."""
    if len(text) > DEFINITION_MAX:
        return False
    theirs = _sections(kind, text)
    expected = _sections(kind, ours)
    return theirs.get(kind) is not None and all(
        theirs.get(each, fields if each in _WELL_KNOWN else None) == fields for each, fields in expected.items()
    )


def _sections(kind: str, text: str) -> Mapping[str, list[Field] | None]:
    """Return the fields of `kind` and of each type defined after it; None for a type with an invalid line."""
    found: dict[str, list[Field] | None] = {kind: []}
    current = kind
    for line in text.splitlines():
        content = line.split("#", 1)[0].strip()
        section = _SECTION.fullmatch(content)
        if section:
            current = _short(section[1])
            found[current] = []
        elif content and not content.startswith("=="):
            _add(found, current, content)
    return found


def _add(found: dict[str, list[Field] | None], current: str, content: str) -> None:
    fields, line = found[current], _LINE.match(content)
    if fields is None or line is None:
        found[current] = None
    elif not line[4]:  # otherwise a constant
        fields.append((_qualified(line[1], current) + line[2], line[3]))


def _qualified(kind: str, inside: str) -> str:
    """Return a field's type with its package. Definitions may omit it for headers and types in their own package."""
    if kind == "Header":
        return "std_msgs/Header"
    if "/" in kind or _PRIMITIVE.fullmatch(kind):
        return _short(kind)
    return f"{inside.partition('/')[0]}/{kind}"


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")
