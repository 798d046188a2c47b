"""The differences between POSIX systems (Linux, macOS) and Windows that affect robochoc."""

from __future__ import annotations

import os

IS_POSIX = hasattr(os, "fork")
"""True if processes can be forked, signals blocked, open files renamed, and descriptors passed to other programs."""
REQUIREMENT = "requires a POSIX system such as Linux or macOS"


def usable_processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
