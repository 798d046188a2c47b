"""ZIP archives of strangers: how much they list is bounded before it is read, as Python reads all of it at once."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MOST_LISTED = 2 << 20
"""Bytes of the list of an archive's files: enough for ten thousand of them."""


class Bounded(io.FileIO):
    """A file of which no more is read at once than `most`.

    Attributes:
        most: As many bytes; None: as many as there are.
    """

    most: int | None = MOST_LISTED

    def read(self, size: int | None = -1) -> bytes:
        """Read. Raises `ValueError` if it would be too much."""
        if self.most is not None:
            here = self.tell()
            rest = self.seek(0, io.SEEK_END) - here
            self.seek(here)
            if (rest if size is None or size < 0 else min(size, rest)) > self.most:
                raise ValueError("it lists too many files")
        return super().read(-1 if size is None else size)


@contextmanager
def bounded_archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open an archive to be read.

    Raises:
        ValueError: if it lists too many files; and what `zipfile.ZipFile` raises.
        OSError: if it cannot be read.
    """
    with Bounded(path) as file, zipfile.ZipFile(file) as archive:
        file.most = None
        yield archive
