"""Memory in large pages, so that a process of many megabytes is forked in two milliseconds and not in forty.

The processes that run the tests hold all tests and what these import, and tests fork them thousands of times. Each fork
copies the table of pages: one entry for 2 MB is copied sooner than 512.

Linux 6.1 and newer; elsewhere nothing happens.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

_MADV_HUGEPAGE = 14
_MADV_COLLAPSE = 25
_LARGE = 1 << 21
"""Bytes of a large page on most machines."""


def use_large_pages() -> None:
    """Put what this process has in its memory by now into large pages, as far as the system does it."""
    advise = ctypes.CDLL(None).madvise
    advise.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
    for begin, end in _own_ranges():
        if end - begin >= _LARGE:
            advise(begin, end - begin, _MADV_HUGEPAGE)
            advise(begin, end - begin, _MADV_COLLAPSE)


def _own_ranges() -> list[tuple[int, int]]:
    """Return the ranges of addresses that are written to and belong to no file: [begin, end)."""
    found = []
    for line in Path("/proc/self/maps").read_text(encoding="ascii", errors="replace").splitlines():
        addresses, rights, _, _, _, *name = line.split(maxsplit=5)
        if rights.startswith("rw-p") and name in ([], ["[heap]"]):
            begin, end = addresses.split("-")
            found.append((int(begin, 16), int(end, 16)))
    return found
