"""Makes untrusted text safe for display on a terminal, on a page, or in a journal.

Names, reasons and messages come from files and from robots of other owners. They must not control the terminal (escape
sequences), reverse the reading direction (bidirectional overrides), break the line, or fill the screen.
"""

from __future__ import annotations

from collections.abc import Iterable

LONGEST = 10_000
"""The maximum number of characters in a line. Lines written by robochoc are shorter."""
LONGEST_REASON = 500
"""The maximum number of characters in the reason why a participant ends or is refused."""
MOST_LISTED = 8
"""The maximum number of items in a list. A longer list is truncated."""


def on_one_line(text: str, longest: int = LONGEST) -> str:
    """Return `text` in a form safe for display: unprintable characters are escaped, and the text is cut at `longest`.

    Control characters, line breaks, marks that change the reading direction and lone surrogates count as unprintable.
    Markup is not changed: code that shows the text as HTML must escape it.
    """
    shown = "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text[:longest])
    return shown if len(text) <= longest else f"{shown}... ({len(text) - longest:,} more characters)"


def printable(text: str) -> str:
    """Return `text` with unprintable characters replaced: control characters and lone surrogates."""
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text)


def listed(things: Iterable[str], conjunction: str = "and") -> str:
    """Return `a`, `a and b`, `a, b and c`, or for a long list `a, b, ... and 12 more`."""
    items = list(things)
    if len(items) > MOST_LISTED + 1:
        items = [*items[:MOST_LISTED], f"{len(items) - MOST_LISTED:,} more"]
        conjunction = "and"
    return f"{', '.join(items[:-1])} {conjunction} {items[-1]}" if len(items) > 1 else "".join(items)


def counted(number: int, thing: str) -> str:
    """Return `1 value`, `3 values`."""
    return f"{number:,} {thing if number == 1 else thing + 's'}"
