"""Names and patterns of robots, such as `Robot3.1,Robot2.*`, in options of `robochoc sniff` and `robochoc journal`.

`*` matches any characters, and `?` any single character, as in the properties of JADE's sniffer.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence


def patterns_in(text: str) -> tuple[str, ...]:
    """Return the names and patterns in `text`, separated by commas."""
    return tuple(part for part in (part.strip() for part in text.split(",")) if part)


def matching(names: Iterable[str], patterns: Sequence[str]) -> list[str]:
    """Return the names that match at least one pattern, in their original order."""
    wholes = [_expression(pattern) for pattern in patterns]
    return [name for name in names if any(whole.fullmatch(name) for whole in wholes)]


def unmatched(names: Iterable[str], patterns: Sequence[str]) -> list[str]:
    """Return the patterns that match no name."""
    known = list(names)
    return [pattern for pattern in patterns if not matching(known, (pattern,))]


def _expression(pattern: str) -> re.Pattern[str]:
    """Return a regular expression in which each part between two `*` matches only its first occurrence.

    Without backtracking, names that almost match are not slow.
    """
    first, *rest = ("".join("." if sign == "?" else re.escape(sign) for sign in part) for part in pattern.split("*"))
    if not rest:
        return re.compile(first, re.DOTALL)
    middle = "".join(f"(?>.*?{part})" for part in rest[:-1])
    return re.compile(f"{first}{middle}.*{rest[-1]}", re.DOTALL)
