"""toulbar2's `.wcsp`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robochoc.formats.dialects.dialect import Dialect, Imported, ImportOptions
from robochoc.formats.dialects.toulbar2.text import has_suffix, read_with
from robochoc.formats.dialects.toulbar2.wcsp_reader import read as read_text
from robochoc.formats.dialects.toulbar2.writer import wcsp


def recognises(path: Path, beginning: bytes) -> bool:
    """Return whether a file is toulbar2's, by its name."""
    return has_suffix(path, ".wcsp") and bool(beginning)


def read(paths: Sequence[Path], options: ImportOptions) -> Imported:
    """Return the problem in a file. Raises `InvalidInputError`."""
    return read_with(paths, options, read_text)


DIALECT = Dialect("wcsp", "toulbar2's wcsp", recognises, read, wcsp)
