"""The texts of the application: a catalogue in the folder `en`, which can be translated.

`say("gallery.title")` returns a text in which each `{name}` is replaced by an argument.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files

from robochoc.formats.toml import toml_tables

LANGUAGE = "en"
_HOLE = re.compile(r"\{([a-z_]+)\}")


def say(key: str, **named: object) -> str:
    """Return the text for a key, with names in braces replaced by arguments. Braces in arguments are not replaced.

    Raises:
        KeyError: if there is no text for this key.
    """
    return _HOLE.sub(lambda hole: str(named.get(hole[1], hole[0])), catalogue()[key])


@cache
def catalogue(language: str = LANGUAGE) -> dict[str, str]:
    """Return all texts in a language, by dotted keys."""
    texts: dict[str, str] = {}
    for file in sorted((files(__package__) / language).iterdir(), key=lambda file: file.name):
        texts |= _flat("", toml_tables(file.read_text(encoding="utf-8")))
    return texts


def _flat(prefix: str, part: dict[str, object]) -> dict[str, str]:
    found: dict[str, str] = {}
    for key, value in part.items():
        found |= _flat(f"{prefix}{key}.", value) if isinstance(value, dict) else {f"{prefix}{key}": str(value)}
    return found
