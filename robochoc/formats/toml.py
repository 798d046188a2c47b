"""Read TOML with limits: the time and memory of `tomllib` grow with the square of the length of a dotted key.

The tables of `tomllib` have no line numbers, so lines are searched in the text when an error is reported.
"""

from __future__ import annotations

import re
import tomllib  # noqa: TID251 - here, and nowhere else
from typing import Any, TypeVar

import msgspec

from robochoc.formats.diagnostics import MistakeError
from robochoc.system.decode_errors import describe_decode_error, place_of

_Kind = TypeVar("_Kind")
MAX_PARTS = 16
"""The maximum number of parts in a dotted key. No file of robochoc needs more than three."""
_HEAD = re.compile(r"\s*\[\[?\s*([\w.-]+)\s*\]?\]")
_STEP = re.compile(r"\[(\d+)\]$")
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+"""
_LONG_KEY = re.compile(rf"(?:^|[{{,\[])[ \t]*+(?:{_PART}\.[ \t]*+){{{MAX_PARTS}}}", re.MULTILINE)


def toml_tables(text: str) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Raises:
        ValueError: if the text is not TOML, is nested too deeply, or has a key of more than `MAX_PARTS` parts.
    """
    found = _LONG_KEY.search(text)
    if found:
        line = 1 + text.count("\n", 0, found.end())
        raise ValueError(f"a key of more than {MAX_PARTS} parts (at line {line})")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def convert(tables: object, kind: type[_Kind], text: str, hint: str, table: str = "") -> _Kind:
    """Convert `tables`, the contents of a file or of one table in it, to a struct.

    Args:
        tables: The decoded TOML.
        kind: The struct.
        text: The text of the file.
        hint: A suggestion to the user in case of an error.
        table: The name of the table in the file. Empty: `tables` contains the whole file.

    Raises:
        MistakeError: if the tables do not fit the fields of the struct. It contains the line.
    """
    try:
        return msgspec.convert(tables, kind)
    except msgspec.ValidationError as error:
        place, field = place_of(error)
        inner, number = _STEP.sub("", place), _STEP.search(place)
        name = ".".join(filter(None, (table, re.sub(r"\[[^]]*\]", "", inner))))
        line = line_of(text, name, field, int(number[1]) if number else 0) if field else _line_of_value(text, name)
        message = describe_decode_error(error, kind)
        raise MistakeError(f"{table}: {message}" if table else message, hint, line) from None


def line_of(text: str, table: str, key: str = "", number: int = 0) -> int:
    """Return the line of a key in a TOML file.

    Args:
        text: The text of the file.
        table: The name of the table. Empty: keys before all tables.
        key: The key. Empty: the table itself.
        number: The index among several tables with that name, from 0.

    Returns:
        The line of the key, or of the table if the key is not found in it; 0 if neither is found.
    """
    found_table, found_number, head = "", 0, 0
    wanted = re.compile(rf"\s*[\"']?{re.escape(key)}[\"']?\s*[=.]") if key else None
    for line, words in enumerate(text.splitlines(), 1):
        if found := _HEAD.match(words):
            found_number = found_number + 1 if found[1] == found_table else 0
            found_table = found[1]
            if key and not table and found_table == key:
                return line
        if (found_table, found_number) == (table, number):
            head = head or line
            if wanted and wanted.match(words):
                return line
        elif table and found_table == f"{table}.{key}":
            return line
    outer, dot, inner = table.rpartition(".")
    if table and not head:  # an inline table
        return line_of(text, outer, inner, number if dot else 0)
    return head if table else 0


def _line_of_value(text: str, name: str) -> int:
    """Return the line of a value. `name` is its dotted name."""
    table, _, key = name.rpartition(".")
    return line_of(text, table, key) if key else 0
