"""Arrays in memory, or in an unnamed file if they are too large for memory.

The file has no name, so nothing remains of it when the process ends, whatever ends it. Its space is reserved when the
array is made: otherwise a full disk would end the process later, at an access to the array.
"""

from __future__ import annotations

import mmap
import os
import shutil
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from robochoc.system.temporary_files import temporary_folder, unnamed_file


def empty_array(shape: Sequence[int], kind: DTypeLike, *, on_disk: bool = False) -> NDArray[Any]:
    """Return a new array whose content is undefined.

    Raises:
        OSError: if the array has to be on the disk, and does not fit there.
    """
    if not on_disk:
        return np.empty(shape, kind)
    size = int(np.prod(shape, dtype=object)) * np.dtype(kind).itemsize
    with unnamed_file(buffered=False) as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size)
        else:  # macOS, Windows
            file.truncate(size)
        mapped = mmap.mmap(file.fileno(), size)
    return np.frombuffer(mapped, kind).reshape(shape)


def release_pages(array: NDArray[Any]) -> None:
    """Remove the pages of an array on the disk from the memory of this process. The array can be used as before."""
    mapped = _map_of(array)
    if mapped is not None and hasattr(mapped, "madvise"):
        mapped.madvise(mmap.MADV_DONTNEED)


def is_on_disk(array: NDArray[Any]) -> bool:
    """Return whether `array`, or the array that it is a view of, is on the disk."""
    return _map_of(array) is not None


def free_disk_bytes() -> int:
    """Return the free space of the folder for temporary files; 0 if there is no such folder."""
    try:
        return shutil.disk_usage(temporary_folder()).free
    except FileNotFoundError:
        return 0


def _map_of(array: NDArray[Any]) -> mmap.mmap | None:
    base: Any = array
    while isinstance(base, np.ndarray):
        base = base.base
    if isinstance(base, memoryview):
        base = base.obj
    return base if isinstance(base, mmap.mmap) else None
