"""Lists of robots and of tasks to be allocated to them, as YAML (docs/guides/tasks.md)."""

from __future__ import annotations

from pathlib import Path

from robochoc.formats.dialects.dialect import Dialect
from robochoc.formats.dialects.pydcop.files import sections
from robochoc.tasks.reader import read

_SECTIONS = {"robots", "tasks"}


def recognises(path: Path, beginning: bytes) -> bool:
    """Return whether a YAML or JSON file begins with robots and tasks. In a long file, robots are sufficient."""
    if path.suffix.lower() not in (".yaml", ".yml", ".json"):
        return False
    found = sections(beginning.decode("utf-8", "replace").lstrip("\ufeff"))
    return found >= _SECTIONS or ("robots" in found and "variables" not in found)


DIALECT = Dialect("tasks", "a list of robots and tasks", recognises, read)
