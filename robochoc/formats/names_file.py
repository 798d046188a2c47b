"""`names.json` in a team's folder: the original names of robots and variables in the files of another tool."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robochoc.formats.diagnostics import invalid_input

NAMES_FILE = "names.json"
MAX_BYTES = 64 * 1024 * 1024


def names_json(dialect: str, names: Mapping[str, str]) -> bytes:
    """Return the content of the file `names.json`.

    Args:
        dialect: The name of the dialect.
        names: Maps names in the team to the original names, where these differ.
    """
    import msgspec  # noqa: PLC0415 - start-up

    content = {"dialect": dialect, "names": dict(names)}
    return msgspec.json.format(msgspec.json.encode(content)) + b"\n"


def original_names(folder: Path) -> Mapping[str, str]:
    """Return the original names from the file in `folder`; empty if the folder has no such file.

    Raises:
        InvalidInputError: if the file does not have the form written by `names_json`.
    """
    import msgspec  # noqa: PLC0415 - start-up

    path = folder / NAMES_FILE
    if not path.is_file():
        return {}
    fields = [("dialect", str), ("names", dict[str, str])]
    form: Any = msgspec.defstruct("NamesFile", fields, forbid_unknown_fields=True)
    try:
        with path.open("rb") as file:
            found = msgspec.json.decode(file.read(MAX_BYTES), type=form)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        hint = "import the problem again, or delete the file"
        raise invalid_input(path, "does not contain the original names of a team", hint) from None
    names: Mapping[str, str] = found.names
    return names
