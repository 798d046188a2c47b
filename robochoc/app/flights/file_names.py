"""Names of downloaded files that are valid on all systems, for any name of a team."""

from __future__ import annotations

import re

_OTHERS = re.compile(r"[^A-Za-z0-9_-]+")
_LONGEST = 60
_USUAL = "team"
_RESERVED = re.compile(r"(?i)(con|prn|aux|nul|com[0-9]|lpt[0-9])")
"""Names of devices on Windows."""


def file_name(name: str, ending: str = "") -> str:
    """Return a file name for `name` with ASCII letters, digits, `_` and `-` only, followed by `ending`."""
    plain = _OTHERS.sub("-", name).strip("-")[:_LONGEST].strip("-")
    return f"{_USUAL if not plain or _RESERVED.fullmatch(plain) else plain}{ending}"
