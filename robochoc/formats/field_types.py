"""Checks that Python objects have the field types of their dataclasses: an `int` for an `int`, no list for a tuple.

Python does not check annotations. Objects created by readers of files have the right types; objects built by a program
may not, and all other code relies on hashable, immutable values.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from typing import Any, Union, get_args, get_origin, get_type_hints

from robochoc.formats.diagnostics import shortened
from robochoc.model.expression import Apply, Constant, Name
from robochoc.system.errors import RobochocError

_LEAVES = (Apply, Constant, Name)
"""Classes of expressions. They may be too deep for recursion, and have a separate check."""

FIELD_TYPES_HINT = "give each field the type that its class declares"
"""The hint for a `FieldTypeError`."""

_Check = Callable[[object], None]


class FieldTypeError(RobochocError, TypeError):
    """Raised if a part of an object has the wrong type. `path` leads to the part."""

    def __init__(self, value: object, expected: str) -> None:
        self.path = ""
        shown = f"'{shortened(value)}'" if isinstance(value, str) else f"a {type(value).__name__}"
        super().__init__(f"{shown} instead of {expected}")

    @property
    def explanation(self) -> str:
        """Return the path to the part, and the error."""
        where = self.path.lstrip(".")
        return f"{where}: {self}" if where else str(self)

    def inside(self, step: str) -> FieldTypeError:
        """Return this error with `step` prepended to its path."""
        self.path = f"{step}{self.path}"
        return self


def check_field_types(value: object, kind: type) -> None:
    """Raise `FieldTypeError` unless `value` and its parts have the types declared by the dataclass `kind`."""
    _check(kind)(value)


@cache
def _check(hint: Any) -> _Check:  # noqa: ANN401 - an annotation
    if get_origin(hint) in {Union, types.UnionType}:
        return _any_of(hint)
    if get_origin(hint) is tuple:
        return _tuple_of(get_args(hint)[0])
    if hint is float:
        return _exactly("a number", int, float)
    if hint is int:
        return _exactly("an integer", int)
    return _FieldsCheck(hint) if is_dataclass(hint) and hint not in _LEAVES else _instance_of(hint)


def _exactly(expected: str, *kinds: type) -> _Check:
    """Return a check for numbers. It rejects True, which is an `int` but cannot be written as a number."""

    def check(value: object) -> None:
        if type(value) not in kinds:
            raise FieldTypeError(value, expected)

    return check


def _instance_of(kind: type) -> _Check:
    def check(value: object) -> None:
        if not isinstance(value, kind):
            expected = f"one of {kind.__name__}" if issubclass(kind, Enum) else f"a {kind.__name__}"
            raise FieldTypeError(value, expected.replace("a NoneType", "None"))

    return check


def _any_of(hint: Any) -> _Check:  # noqa: ANN401 - an annotation
    options = get_args(hint)
    checks = {option: _check(option) for option in options if option not in _LEAVES}
    expected = " or ".join("None" if option is type(None) else option.__name__ for option in options)

    def check(value: object) -> None:
        found = next((option for option in options if isinstance(value, option)), None)
        if found is None:
            raise FieldTypeError(value, expected)
        if found in checks:
            checks[found](value)

    return check


def _tuple_of(item: Any) -> _Check:  # noqa: ANN401 - an annotation
    check_item = _check(item)

    def check(value: object) -> None:
        if not isinstance(value, tuple):
            raise FieldTypeError(value, "a tuple")
        if item is int and all(type(one) is int for one in value):
            return
        for number, one in enumerate(value):
            try:
                check_item(one)
            except FieldTypeError as error:
                raise error.inside(f"[{number}]") from None

    return check


class _FieldsCheck:
    """Checks a dataclass and all its fields."""

    def __init__(self, kind: Any) -> None:  # noqa: ANN401 - a dataclass
        self._kind = kind
        self._check_class = _instance_of(kind)

    def __call__(self, value: object) -> None:
        self._check_class(value)
        for name, check in _fields_of(self._kind):
            try:
                check(getattr(value, name))
            except FieldTypeError as error:
                raise error.inside(f".{name}") from None


@cache
def _fields_of(kind: Any) -> tuple[tuple[str, _Check], ...]:  # noqa: ANN401 - a dataclass
    hints = get_type_hints(kind)
    return tuple((field.name, _check(hints[field.name])) for field in fields(kind))
