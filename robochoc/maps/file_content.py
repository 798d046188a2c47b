"""Reads the content of map files, up to a maximum size, and adds the file's name to errors."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robochoc.formats.diagnostics import MistakeError, invalid_input


@contextmanager
def as_input_errors(path: Path) -> Iterator[None]:
    """Convert errors of reading a file to `InvalidInputError`, with the file's name."""
    try:
        yield
    except OSError as error:
        raise invalid_input(path, error.strerror or str(error), "name a file that can be read") from None
    except MistakeError as mistake:
        raise invalid_input(path, mistake.message, mistake.hint, mistake.line) from None


def read_content(path: Path, most: int) -> bytes:
    """Return the content of a file.

    Raises:
        OSError: The file cannot be read.
        MistakeError: The path is not a regular file, or the file has more than `most` bytes.
    """
    content = read_beginning(path, most + 1)
    if len(content) > most:
        raise MistakeError("is too large", f"it may have {most:,} bytes")
    return content


def read_beginning(path: Path, most: int) -> bytes:
    """Return the first `most` bytes of a file, or the whole file if it is shorter.

    Raises:
        OSError: The file cannot be read.
        MistakeError: The path is not a regular file.
    """
    if path.exists() and not stat.S_ISREG(path.stat().st_mode):
        raise MistakeError("is not a file", "name a file")
    with path.open("rb") as file:
        return file.read(most)
