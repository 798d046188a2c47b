"""pyDCOP's YAML (https://github.com/Orange-OpenSource/pyDcop): problems, distributions and scenarios."""

from __future__ import annotations

from pathlib import Path

from robochoc.formats.dialects.dialect import Dialect
from robochoc.formats.dialects.pydcop.files import sections
from robochoc.formats.dialects.pydcop.reader import read
from robochoc.formats.dialects.pydcop.writer import write

_BEGINS = {"objective", "domains"}
_SECTIONS = {"domains", "variables", "constraints", "objective", "distribution", "events", "agents", "replica_dist"}


def recognises(path: Path, beginning: bytes) -> bool:
    """Return whether a file is pyDCOP's: YAML by its name, with a known section; or the beginning of a problem."""
    found = sections(beginning.decode("utf-8", "replace").lstrip("\ufeff"))
    if path.suffix.lower() in (".yaml", ".yml"):
        return bool(found & _SECTIONS)
    return not beginning.lstrip().startswith((b"<", b"{")) and found >= _BEGINS


DIALECT = Dialect("pydcop", "pyDCOP's YAML", recognises, read, write)
