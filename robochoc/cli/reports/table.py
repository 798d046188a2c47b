"""A table with aligned columns and no lines, so that other programs can also read it from a pipe."""

from __future__ import annotations

import sys
import unicodedata
from collections.abc import Collection, Iterable, Iterator, Sequence
from textwrap import wrap

import click

from robochoc.system.plain_text import on_one_line

GAP = "  "
NARROWEST = 18
"""The minimum width of a wrapped column, in characters."""


def print_table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], *, right: Collection[str] = (), prose: str = ""
) -> None:
    """Print a table on standard output. On a terminal, headings are bold, and prose is wrapped to the terminal's width.

    Args:
        headings: The heading of each column.
        rows: The cells of each row. Unprintable characters are escaped.
        right: The headings of right-aligned columns, which contain numbers.
        prose: The heading of the column that may be wrapped.
    """
    terminal = sys.stdout.isatty()
    import shutil

    width = shutil.get_terminal_size().columns if terminal else None
    for number, line in enumerate(table_lines(headings, rows, right=right, prose=prose, width=width)):
        click.echo(click.style(line, bold=True) if terminal and number == 0 else line)


def table_lines(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    right: Collection[str] = (),
    prose: str = "",
    width: int | None = None,
) -> list[str]:
    """Return the lines of a table, headings first. `width`: the width of the terminal. See `print_table`."""
    cells = [list(headings), *([on_one_line(cell) for cell in row] for row in rows)]
    widths = [max(map(_width, column)) for column in zip(*cells, strict=True)]
    if prose and width is not None:
        place = headings.index(prose)
        others = sum(widths) - widths[place] + len(GAP) * (len(widths) - 1)
        widths[place] = max(NARROWEST, min(widths[place], width - others))
    to_the_right = [heading in right for heading in headings]
    return [line for row in cells for line in _lines(row, widths, to_the_right)]


def _lines(row: Sequence[str], widths: Sequence[int], right: Sequence[bool]) -> Iterator[str]:
    """Yield the lines of one row; there are several if a cell is wider than its column."""
    parts = [[cell] if _width(cell) <= width else wrap(cell, width) for cell, width in zip(row, widths, strict=True)]
    for number in range(max(map(len, parts))):
        line = (part[number] if number < len(part) else "" for part in parts)
        yield GAP.join(map(_aligned, line, widths, right)).rstrip()


def _aligned(cell: str, width: int, right: bool) -> str:  # noqa: FBT001 - mapped
    blanks = " " * (width - _width(cell))
    return f"{blanks}{cell}" if right else f"{cell}{blanks}"


def _width(text: str) -> int:
    """Return the width of `text` on a terminal, in columns (Unicode Standard Annex 11)."""
    if text.isascii():
        return len(text)
    return sum(0 if unicodedata.combining(char) else 1 + (unicodedata.east_asian_width(char) in "WF") for char in text)
