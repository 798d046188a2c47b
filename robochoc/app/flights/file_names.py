"""Names of files that are handed on: whatever a team is called, any system can keep them."""

from __future__ import annotations

import re

_OTHERS = re.compile(r"[^A-Za-z0-9_-]+")
_LONGEST = 60
_USUAL = "team"
_RESERVED = re.compile(r"(?i)(con|prn|aux|nul|com[0-9]|lpt[0-9])")
"""Windows keeps these for devices."""


def file_name(name: str, ending: str = "") -> str:
    """Return a file's name for `name`: ASCII letters, digits, `_` and `-`; then `ending`."""
    plain = _OTHERS.sub("-", name).strip("-")[:_LONGEST].strip("-")
    return f"{_USUAL if not plain or _RESERVED.fullmatch(plain) else plain}{ending}"
