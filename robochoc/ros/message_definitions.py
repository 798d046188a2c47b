"""Message definitions as text, from recordings of unknown origin: are their fields those that we know?

Only lines are compared. A definition is never parsed into types: a parser that makes program text of it would run what
others have written.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

Field = tuple[str, str]
"""The type and the name of a field."""

DEFINITION_MAX = 1 << 15
"""Characters of a definition; those known here have some 5,000."""

_LINE = re.compile(r"([A-Za-z][\w/]*)((?:<=\d+)?(?:\[[<=\d]*\])?)\s+([A-Za-z]\w*)\s*(=?)", re.ASCII)
_SECTION = re.compile(r"MSG:\s*([\w/]+)\s*", re.ASCII)
_OWN = re.compile(r"bool|byte|char|u?int(?:8|16|32|64)|float(?:32|64)|w?string|time|duration")
_WELL_KNOWN = {"builtin_interfaces/Time", "builtin_interfaces/Duration"}
"""Not every writer defines these."""


def same_fields(kind: str, text: str, ours: str) -> bool:
    """Return whether `text` gives `kind`, and the types of its fields, the same fields as `ours`."""
    if len(text) > DEFINITION_MAX:
        return False
    theirs = _sections(kind, text)
    expected = _sections(kind, ours)
    return theirs.get(kind) is not None and all(
        theirs.get(each, fields if each in _WELL_KNOWN else None) == fields for each, fields in expected.items()
    )


def _sections(kind: str, text: str) -> Mapping[str, list[Field] | None]:
    """Return the fields of `kind`, and of each type that is defined behind it; None where a line is no field."""
    found: dict[str, list[Field] | None] = {kind: []}
    current = kind
    for line in text.splitlines():
        content = line.split("#", 1)[0].strip()
        section = _SECTION.fullmatch(content)
        if section:
            current = _short(section[1])
            found[current] = []
        elif content and not content.startswith("=="):
            _add(found, current, content)
    return found


def _add(found: dict[str, list[Field] | None], current: str, content: str) -> None:
    fields, line = found[current], _LINE.match(content)
    if fields is None or line is None:
        found[current] = None
    elif not line[4]:  # else it is a constant
        fields.append((_qualified(line[1], current) + line[2], line[3]))


def _qualified(kind: str, inside: str) -> str:
    """Return a field's type with its package, which may be left out for those of its own, and for a header."""
    if kind == "Header":
        return "std_msgs/Header"
    if "/" in kind or _OWN.fullmatch(kind):
        return _short(kind)
    return f"{inside.partition('/')[0]}/{kind}"


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")
