"""TOML, within bounds: `tomllib` takes time and memory that grow with the square of the parts of a dotted key."""

from __future__ import annotations

import re
import tomllib  # noqa: TID251 - here, and nowhere else
from typing import Any

MAX_PARTS = 16
"""The maximum number of parts of a dotted key. Nothing that is read here needs more than three."""
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
