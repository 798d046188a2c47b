"""msgspec's errors on invalid JSON, TOML values and settings, reworded in plain words."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from enum import Enum
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec

_PLACE = re.compile(r" - at `\$\.?(?P<place>[^`]*)`$")
_UNKNOWN = re.compile(r"Object contains unknown field `([^`]*)`")
_TYPES = {
    "int": "an integer",
    "float": "a number",
    "str": "a text",
    "bool": "true or false",
    "null": "null",
    "array": "a list",
    "object": "an object",
}
"""JSON types, by their names in msgspec's messages."""

_SENTENCES = (
    (r"Invalid (?:enum )?value (?P<value>.*)", "{value} is not allowed{allowed}"),
    (r"Expected `(?P<expected>[^`]*)`, got `(?P<got>[^`]*)`", "expected {expected}, found {got}"),
    (r"Expected `(?P<expected>[^`]*)`(?P<rest>.*)", "expected {expected}{rest}"),
    (r"Object missing required field `(?P<value>[^`]*)`", "the field '{value}' is missing"),
    (r"Object contains unknown field `(?P<value>[^`]*)`", "there is no field '{value}'{nearest}"),
    (r"JSON is malformed: (?P<value>.*)", "it is not valid JSON: {value}"),
    (r"Input data was truncated", "it is not valid JSON: it ends too early"),
)
"""Patterns of msgspec's messages, and their replacements."""


def describe_decode_error(error: msgspec.MsgspecError, expected: Any) -> str:  # noqa: ANN401 - a type
    """Return the error, its location, the expected type, and the allowed values if there are only a few.

    Args:
        error: The error raised by msgspec.
        expected: The type to be decoded.
    """
    text = str(error)
    found = _PLACE.search(text)
    place = found["place"] if found else ""
    text = _PLACE.sub("", text)
    for pattern, sentence in _SENTENCES:
        match = re.fullmatch(pattern, text)
        if match:
            parts = {name: part or "" for name, part in match.groupdict().items()}
            parts |= {name: _named(parts[name]) for name in ("expected", "got") if name in parts}
            allowed = _allowed(expected, place)
            parts |= {"allowed": _one_of(allowed), "nearest": _nearest(parts.get("value", ""), allowed)}
            text = sentence.format(**parts)
            break
    return f"{place}: {text}" if place else text


def place_of(error: msgspec.MsgspecError) -> tuple[str, str]:
    """Return the location of the invalid value, such as `links[1]`, and the name of its unknown field, if any."""
    text = str(error)
    place, field = _PLACE.search(text), _UNKNOWN.match(text)
    return place["place"] if place else "", field[1] if field else ""


def _named(types: str) -> str:
    """Return JSON types in words: "an integer or null" for `int | null`."""
    return " or ".join(_TYPES.get(one, one) for one in types.split(" | "))


def _allowed(kind: Any, place: str) -> Sequence[str]:  # noqa: ANN401 - a type
    """Return the values or fields that are allowed at `place`; empty if the type does not list them."""
    for step in re.findall(r"\w+|\[[^]]*\]", place):
        kind = _inside(kind, step)
    for option in _options(kind):
        if isinstance(option, type) and issubclass(option, Enum):
            return [str(member.value) for member in option]
        if get_origin(option) is Literal:
            return [str(value) for value in get_args(option)]
        if isinstance(option, type) and issubclass(option, msgspec.Struct):
            return [field.encode_name for field in msgspec.structs.fields(option)]
    return ()


def _inside(kind: Any, step: str) -> Any:  # noqa: ANN401 - types
    """Return the type of the field or item `step` in a value of type `kind`, or None if it is unknown."""
    for option in _options(kind):
        if step.startswith("[") and get_args(option):
            return get_args(option)[1 if get_origin(option) in {dict, Mapping} else 0]
        if isinstance(option, type) and not step.startswith("["):
            return get_type_hints(option).get(step)
    return None


def _options(kind: Any) -> Sequence[Any]:  # noqa: ANN401 - types
    return get_args(kind) if get_origin(kind) in {Union, UnionType} else (kind,)


def _one_of(values: Sequence[str]) -> str:
    return f"; allowed: {', '.join(values)}" if values else ""


def _nearest(name: str, known: Sequence[str]) -> str:
    """Return a hint with the known name that is most similar to `name`, or with all known names."""
    import difflib  # noqa: PLC0415 - start-up: only needed for errors

    close = difflib.get_close_matches(name[:40], known, n=1)
    return f"; did you mean '{close[0]}'?" if close else _one_of(known)
