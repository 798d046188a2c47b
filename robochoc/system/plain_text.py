"""Text of others as it may be shown: on a terminal, on a page, in a journal in words. One function, for all of it.

Names, reasons and messages come from files and from robots of other owners. Their authors must not be able to speak to
the terminal (escape sequences), turn what is read around (bidirectional overrides), break the line, or fill the screen.
"""

from __future__ import annotations

from collections.abc import Iterable

LONGEST = 10_000
"""Characters. Our own lines are shorter."""
LONGEST_REASON = 500
"""The maximum number of characters of the reason why a participant ends, or is refused."""
MOST_LISTED = 8
"""The maximum number of items in a list; a longer list is cut."""


def on_one_line(text: str, longest: int = LONGEST) -> str:
    """Return `text` as it may be shown: what does not print is escaped, and what is beyond `longest` left out.

    Controls, line breaks, marks that change the direction of writing, lone surrogates: none of them prints. Markup is
    only text here: code that shows it as HTML has to escape that as well.
    """
    shown = "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text[:longest])
    return shown if len(text) <= longest else f"{shown}... ({len(text) - longest:,} more characters)"


def printable(text: str) -> str:
    """Return `text` with a mark in place of what is not printable: control characters, half a surrogate pair."""
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text)


def listed(things: Iterable[str], conjunction: str = "and") -> str:
    """Return `a`, `a and b`, `a, b and c`; of many `a, b, ... and 12 more`."""
    items = list(things)
    if len(items) > MOST_LISTED + 1:
        items = [*items[:MOST_LISTED], f"{len(items) - MOST_LISTED:,} more"]
        conjunction = "and"
    return f"{', '.join(items[:-1])} {conjunction} {items[-1]}" if len(items) > 1 else "".join(items)


def counted(number: int, thing: str) -> str:
    """Return `1 value`, `3 values`."""
    return f"{number:,} {thing if number == 1 else thing + 's'}"
