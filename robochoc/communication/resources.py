"""Resources of the operating system for a run: enough descriptors, and its memory."""

from __future__ import annotations

import os
import resource
from pathlib import Path

from robochoc.solver.encoding import UnsupportedError

_MOST_TOLD = 1 << 16
"""More bytes than the system tells of one process."""


def allow_descriptors(needed: int) -> None:
    """Raise the soft limit of open files towards the hard one where the team needs it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < needed:
        limit = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


def require_descriptors(free: int) -> None:
    """Raise `UnsupportedError` unless `free` more files can be opened; the soft limit is raised as far as it goes.

    zenoh does not come back from a lack of them: it aborts the process.
    """
    try:
        in_use = sum(1 for _ in Path("/dev/fd").iterdir())
    except OSError:  # there is not even one for the folder
        in_use = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    allow_descriptors(in_use + free)
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit not in {resource.RLIM_INFINITY, -1} and limit - in_use < free:
        raise UnsupportedError(
            f"too few files may be open: {limit}, with {in_use} in use and {free} more needed; say: ulimit -n 1024"
        )


def own_memory() -> int:
    """Return the bytes that this process shares with no other. 0 where the system does not report them."""
    lines = read_text("/proc/self/smaps_rollup").splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Private_")) * 1024


def read_text(path: str) -> str:
    """Return what the system tells in one of its own small files, or nothing. A `Path` takes four times as long."""
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return ""
    try:
        return os.read(fd, _MOST_TOLD).decode()
    except OSError:  # the process has ended meanwhile
        return ""
    finally:
        os.close(fd)
