"""Names of robots, or patterns of them, as `robochoc sniff` and `robochoc journal` take them: `Robot3.1,Robot2.*`.

`*` matches any characters, `?` any single character, as in the properties of JADE's sniffer.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence


def patterns_in(text: str) -> tuple[str, ...]:
    """Return the names and patterns in `text`, which are separated by commas."""
    return tuple(part for part in (part.strip() for part in text.split(",")) if part)


def matching(names: Iterable[str], patterns: Sequence[str]) -> list[str]:
    """Return those of `names` that match one of `patterns`, in their order."""
    wholes = [_expression(pattern) for pattern in patterns]
    return [name for name in names if any(whole.fullmatch(name) for whole in wholes)]


def unmatched(names: Iterable[str], patterns: Sequence[str]) -> list[str]:
    """Return those of `patterns` that match none of `names`."""
    known = list(names)
    return [pattern for pattern in patterns if not matching(known, (pattern,))]


def _expression(pattern: str) -> re.Pattern[str]:
    """Return a regular expression in which each part between two `*` matches its first place only.

    Without backtracking, names that nearly match take no more time.
    """
    first, *rest = ("".join("." if sign == "?" else re.escape(sign) for sign in part) for part in pattern.split("*"))
    if not rest:
        return re.compile(first, re.DOTALL)
    middle = "".join(f"(?>.*?{part})" for part in rest[:-1])
    return re.compile(f"{first}{middle}.*{rest[-1]}", re.DOTALL)
