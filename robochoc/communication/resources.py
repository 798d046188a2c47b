"""Operating system resources for a run: file descriptors and memory."""

from __future__ import annotations

import os
import resource
from pathlib import Path

from robochoc.solver.errors import UnsupportedError

_MOST_TOLD = 1 << 16
"""An upper bound of the number of bytes that the system reports about a process."""


def allow_descriptors(needed: int) -> None:
    """Raise the soft limit of open files to `needed`, or to the hard limit if that is lower."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < needed:
        limit = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


def require_descriptors(free: int) -> None:
    """Raise `UnsupportedError` unless `free` more files can be opened. The soft limit is raised first if necessary.

    Without enough descriptors zenoh aborts the process.
    """
    try:
        in_use = sum(1 for _ in Path("/dev/fd").iterdir())
    except OSError:  # no descriptor is left, not even for this folder
        in_use = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    allow_descriptors(in_use + free)
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit not in {resource.RLIM_INFINITY, -1} and limit - in_use < free:
        raise UnsupportedError(
            f"the limit of {limit} open files is too low: {in_use} are in use and {free} more are needed;"
            " raise it by: ulimit -n 1024"
        )


def own_memory() -> int:
    """Return this process's private memory in bytes; 0 if the system does not report it."""
    lines = read_text("/proc/self/smaps_rollup").splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Private_")) * 1024


def resident_memory() -> int:
    """Return the size of this process's memory in bytes, without files but with pages shared with its parent.

    It is 0 if the system does not report it. Unlike `own_memory`, the system need not visit each page.
    """
    pages = read_text("/proc/self/statm").split()
    return (int(pages[1]) - int(pages[2])) * resource.getpagesize() if pages else 0


def read_text(path: str) -> str:
    """Return the text in a small system file; empty if it cannot be read. Using a `Path` takes four times as long."""
    try:
        fd = os.open(path, os.O_RDONLY)
    except OSError:
        return ""
    try:
        return os.read(fd, _MOST_TOLD).decode()
    except OSError:  # the process has ended in the meantime
        return ""
    finally:
        os.close(fd)
