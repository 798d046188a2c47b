"""The texts of the application: one catalogue, the files of the folder `en`, so that others can translate it.

`say("gallery.title")` returns a text; `{name}` in it is filled in. Nothing is computed in a text.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files

from robochoc.formats.toml import toml_tables

LANGUAGE = "en"
_HOLE = re.compile(r"\{([a-z_]+)\}")


def say(key: str, **named: object) -> str:
    """Return the text of that key, with what it names filled in. Braces in what is filled in mean nothing.

    Raises:
        KeyError: if there is no such text.
    """
    return _HOLE.sub(lambda hole: str(named.get(hole[1], hole[0])), catalogue()[key])


@cache
def catalogue(language: str = LANGUAGE) -> dict[str, str]:
    """Return all texts of a language, by dotted keys."""
    whole: dict[str, str] = {}
    for file in sorted((files(__package__) / language).iterdir(), key=lambda file: file.name):
        whole |= _flat("", toml_tables(file.read_text(encoding="utf-8")))
    return whole


def _flat(prefix: str, part: dict[str, object]) -> dict[str, str]:
    found: dict[str, str] = {}
    for key, value in part.items():
        found |= _flat(f"{prefix}{key}.", value) if isinstance(value, dict) else {f"{prefix}{key}": str(value)}
    return found
