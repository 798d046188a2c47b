"""Reads the content of map files: bounded, and told with the file's name where it cannot be read."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robochoc.formats.diagnostics import MistakeError, invalid_input


@contextmanager
def told(path: Path) -> Iterator[None]:
    """Raise `InvalidInputError`, with the file's name, for what is wrong in it."""
    try:
        yield
    except OSError as error:
        raise invalid_input(path, error.strerror or str(error), "name a file that can be read") from None
    except MistakeError as mistake:
        raise invalid_input(path, mistake.message, mistake.hint, mistake.line) from None


def content_of(path: Path, most: int) -> bytes:
    """Return what a file holds.

    Raises:
        OSError: It cannot be read.
        MistakeError: It is no regular file, or has more than `most` bytes.
    """
    content = beginning_of(path, most + 1)
    if len(content) > most:
        raise MistakeError("is too large", f"it may have {most:,} bytes")
    return content


def beginning_of(path: Path, most: int) -> bytes:
    """Return the first bytes of a file. Raises as `content_of`; a longer file is none of its mistakes."""
    if path.exists() and not stat.S_ISREG(path.stat().st_mode):
        raise MistakeError("is no file", "name a file")
    with path.open("rb") as file:
        return file.read(most)
