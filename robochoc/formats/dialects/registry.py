"""The dialects by name, and which of them a file is in.

Each is a module of this package that ends in `DIALECT = Dialect(...)`. It is imported when it is asked for.
"""

from __future__ import annotations

import codecs
import importlib
import os
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, encodable
from robochoc.formats.dialects.dialect import MAX_FILE, Dialect, ImportOptions, ImportResult

NAMES = ("frodo", "xdiscsp", "dcopsolver", "tasks", "pydcop", "xcsp3", "cfn", "wcsp", "dot", "graphml")
"""The names of all dialects, in the order in which they are asked whether a file is in them."""

_BEGINNING = 64 * 1024
"""The bytes of a file by which it is recognised."""


def find_dialect(name: str) -> Dialect | None:
    """Return the dialect called `name`. None: this version has none of that name."""
    module = f"{__package__}.{name}"
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
    """Return the dialect that the file at `path` is in. None: it is in none, or is no file that can be read."""
    beginning = first_bytes(path)
    if beginning is None:
        return None
    return next((dialect for dialect in dialects() if dialect.recognises(path, beginning)), None)


def read_foreign(paths: Sequence[Path], options: ImportOptions, name: str | None = None) -> ImportResult:
    """Return the problem in the files `paths` of another tool.

    Args:
        paths: The files of one problem.
        options: What the import is asked.
        name: The name of the dialect. None: it is recognised.

    Raises:
        InvalidInputError: if a file is in no dialect that is read here, the files are in several, or they are invalid.
    """
    found = [find_dialect(name) if name else recognise(path) for path in paths]
    for path, dialect in zip(paths, found, strict=True):
        if dialect is None:
            raise unknown_format_error(path)
        if dialect is not found[0]:
            first = found[0].title if found[0] else ""
            raise _invalid(path, f"is {dialect.title}, and {paths[0]} is {first}", "import them one by one")
        if path.stat().st_size > MAX_FILE:
            raise _invalid(path, f"is larger than {MAX_FILE // 2**20} MiB", "import a smaller problem")
    if not found or found[0] is None:
        raise ValueError("no file")
    return found[0].read(paths, options)


def first_bytes(path: Path) -> bytes | None:
    """Return the first bytes of a regular file; None where there is none. A FIFO is not waited for."""
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
    """Return the dialect that the file at `path` is in. None: it is no file, or may be that of a robot.

    Raises:
        InvalidInputError: if it is a file, and neither.
    """
    dialect = recognise(path)
    if dialect is None and path.is_file() and (_is_wide(path) or path.suffix.lower() not in {"", ".xml"}):
        raise unknown_format_error(path)
    return dialect


def _is_wide(path: Path) -> bool:
    """Return whether a file begins as a text in UTF-16 or UTF-32 does: by its mark, or with zeros."""
    first = (first_bytes(path) or b"")[:4]
    return first.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" in first


def unknown_format_error(path: Path) -> InvalidInputError:
    """Return the error of a file that is in no dialect, or not there."""
    if not path.exists():
        return _invalid(path, "does not exist", "check its name")
    if _is_wide(path):
        return _invalid(path, "is not UTF-8: it looks like UTF-16", "save it in UTF-8")
    return _invalid(path, "is of no format that is read here", "'robochoc import --help' lists those that are")


def _invalid(path: Path, message: str, hint: str) -> InvalidInputError:
    return InvalidInputError([Diagnostic(encodable(str(path)), 0, message, hint)])
