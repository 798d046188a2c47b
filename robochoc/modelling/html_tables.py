"""Tables in HTML. All texts are escaped, since they may come from other people's files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from robochoc.system.plain_text import printable

MAX_ROWS = 40
"""The maximum number of rows in a table. If there are more, the number of hidden rows is shown."""
MAX_TEXT = 200
"""The maximum number of characters in a cell."""

_CELL = "text-align:left;vertical-align:top;padding:.15rem .6rem"


def text(value: object) -> str:
    """Return `value` as text escaped for HTML, cut after `MAX_TEXT` characters."""
    shown = printable(str(value))
    return escape(shown if len(shown) <= MAX_TEXT else f"{shown[: MAX_TEXT - 1]}…")


def heading(words: str, details: str = "") -> str:
    """Return a heading with `words` in bold, followed by `details`."""
    more = f' <span style="opacity:.7">{text(details)}</span>' if details else ""
    return f'<p style="margin:.3rem 0"><b>{text(words)}</b>{more}</p>'


def table(titles: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table with a title for each column, or an empty text without rows."""
    listed = list(rows)
    if not listed:
        return ""
    head = "".join(f'<th style="{_CELL}">{text(title)}</th>' for title in titles)
    body = "".join(map(_row, listed[:MAX_ROWS]))
    more = len(listed) - MAX_ROWS
    rest = f'<p style="opacity:.7;margin:.2rem 0">... and {more:,} more</p>' if more > 0 else ""
    return f'<table style="margin:.3rem 0"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{rest}'


def _row(cells: Sequence[object]) -> str:
    return f"<tr>{''.join(map(_cell, cells))}</tr>"


def _cell(value: object) -> str:
    return f'<td style="{_CELL}">{text(value)}</td>'
