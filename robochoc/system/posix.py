"""The differences between POSIX systems (Linux, macOS) and Windows that affect robochoc."""

from __future__ import annotations

import os

IS_POSIX = hasattr(os, "fork")
"""True if processes can be forked, signals blocked, open files renamed, and descriptors passed to other programs."""
REQUIREMENT = "requires a POSIX system such as Linux or macOS"
