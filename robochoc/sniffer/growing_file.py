"""Reads a journal's file while another process writes it."""

from __future__ import annotations

import io
import os
import stat
from pathlib import Path
from typing import Any

from robochoc.system.errors import RobochocError

_HEAD_BYTES = 256


class NoFileError(RobochocError, OSError):
    """The path is a pipe, device or folder, which cannot be read repeatedly."""


def open_to_read(path: Path) -> int:
    """Open the file at `path` for reading without waiting for a FIFO, and return its descriptor. Raises `OSError`."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        _check_file(descriptor)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _check_file(descriptor: int) -> None:
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        raise NoFileError("it is not a regular file")


class GrowingFile(io.RawIOBase):
    """Reads the file `descriptor` from the start up to `end`, which the caller increases by `widen`.

    Its position is independent of other users of the same open file, such as a parent process that writes it.
    """

    def __init__(self, descriptor: int) -> None:
        _check_file(descriptor)
        self._descriptor = descriptor
        self.place = 0
        self.end = 0

    @property
    def size(self) -> int:
        """The current length of the file."""
        return os.fstat(self._descriptor).st_size

    @property
    def head(self) -> bytes:
        """The file's first bytes, which identify a journal."""
        return self._read_at(_HEAD_BYTES, 0)

    def widen(self, most: int) -> bool:
        """Increase `end` by up to `most` existing bytes. Return whether there were any."""
        before, self.end = self.end, min(self.size, self.end + most)
        return self.end > before

    def again(self) -> GrowingFile:
        """Return a reader of the same file that begins at the start."""
        return GrowingFile(self._descriptor)

    def readable(self) -> bool:
        """Return True."""
        return True

    def seekable(self) -> bool:
        """Return True."""
        return True

    def tell(self) -> int:
        """Return the current position."""
        return self.place

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move the position to `offset`, relative to the start, the position, or `end`, and return it."""
        self.place = max(0, offset + {os.SEEK_SET: 0, os.SEEK_CUR: self.place, os.SEEK_END: self.end}[whence])
        return self.place

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401 - whatever holds bytes
        """Read into `buffer`, and return the number of bytes read, which is 0 at `end`."""
        content = self._read_at(min(len(buffer), max(0, self.end - self.place)), self.place)
        buffer[: len(content)] = content
        self.place += len(content)
        return len(content)

    def _read_at(self, size: int, place: int) -> bytes:
        if hasattr(os, "pread"):
            return os.pread(self._descriptor, size, place)
        os.lseek(self._descriptor, place, os.SEEK_SET)  # Windows, where no other process writes the open file
        return os.read(self._descriptor, size)
