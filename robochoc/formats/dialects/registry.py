"""Find a dialect by its name, or by the contents of a file.

Each dialect is a module of this package that ends in `DIALECT = Dialect(...)`, or a package of a higher layer. It is
imported on first use.
"""

from __future__ import annotations

import codecs
import importlib
import os
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import MappingProxyType

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, encodable
from robochoc.formats.dialects.dialect import MAX_FILE, Dialect, ImportOptions, ImportResult

NAMES = ("frodo", "xdiscsp", "dcopsolver", "tasks", "pydcop", "xcsp3", "cfn", "wcsp", "dot", "graphml")
"""The names of all dialects, in the order in which they are tried on a file."""

_ELSEWHERE = MappingProxyType({"tasks": "robochoc.tasks"})
"""The packages of dialects in higher layers; lists of tasks may have maps."""
_BEGINNING = 64 * 1024
"""The number of bytes at the beginning of a file used to detect its format."""


def find_dialect(name: str) -> Dialect | None:
    """Return the dialect called `name`, or None if this version has no such dialect."""
    module = _ELSEWHERE.get(name, f"{__package__}.{name}")
    if name not in NAMES:
        return None
    try:
        found: Dialect = importlib.import_module(module).DIALECT
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        return None
    return found


def dialects() -> Iterator[Dialect]:
    """Yield all dialects."""
    for name in NAMES:
        if dialect := find_dialect(name):
            yield dialect


def recognise(path: Path) -> Dialect | None:
    """Return the dialect of the file at `path`, or None if the format is unknown or the file cannot be read."""
    beginning = first_bytes(path)
    if beginning is None:
        return None
    return next((dialect for dialect in dialects() if dialect.recognises(path, beginning)), None)


def read_foreign(paths: Sequence[Path], options: ImportOptions, name: str | None = None) -> ImportResult:
    """Return another tool's problem, read from the files `paths`.

    Args:
        paths: The files of one problem.
        options: The options of the import.
        name: The name of the dialect. None: the dialect is detected.

    Raises:
        InvalidInputError: if a file's format is unknown, the files have different formats, or they are invalid.
    """
    found = [find_dialect(name) if name else recognise(path) for path in paths]
    for path, dialect in zip(paths, found, strict=True):
        if dialect is None:
            raise unknown_format_error(path)
        if dialect is not found[0]:
            first = found[0].title if found[0] else ""
            message = f"is in the format {dialect.title}, but {paths[0]} is in {first}"
            raise _invalid(path, message, "import files of one format at a time")
        if path.stat().st_size > MAX_FILE:
            raise _invalid(path, f"is larger than {MAX_FILE // 2**20} MiB", "import a smaller problem")
    if not found or found[0] is None:
        raise ValueError("read_foreign requires at least one file")
    return found[0].read(paths, options)


def first_bytes(path: Path) -> bytes | None:
    """Return the first bytes of a regular file, or None if there is no such file. Does not block on a FIFO."""
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        return None
    try:
        return os.read(descriptor, _BEGINNING) if stat.S_ISREG(os.fstat(descriptor).st_mode) else None
    except OSError:
        return None
    finally:
        os.close(descriptor)


def recognise_or_raise(path: Path) -> Dialect | None:
    """Return the dialect of the file at `path`, or None if it is not a file, or may be a robot's file.

    Raises:
        InvalidInputError: if it is a file in an unknown format.
    """
    dialect = recognise(path)
    if dialect is None and path.is_file() and (_is_wide(path) or path.suffix.lower() not in {"", ".xml"}):
        raise unknown_format_error(path)
    return dialect


def _is_wide(path: Path) -> bool:
    """Return whether a file looks like UTF-16 or UTF-32: a byte order mark, or zeros among its first bytes."""
    first = (first_bytes(path) or b"")[:4]
    return first.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" in first


def unknown_format_error(path: Path) -> InvalidInputError:
    """Return the error for a file whose format is unknown, or that does not exist."""
    if not path.exists():
        return _invalid(path, "does not exist", "check its name")
    if _is_wide(path):
        return _invalid(path, "is not UTF-8: it looks like UTF-16", "save it in UTF-8")
    return _invalid(path, "has an unknown format", "'robochoc import --help' lists the supported formats")


def _invalid(path: Path, message: str, hint: str) -> InvalidInputError:
    return InvalidInputError([Diagnostic(encodable(str(path)), 0, message, hint)])
