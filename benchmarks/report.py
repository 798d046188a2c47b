"""The form of what was measured: sections of prose and tables, readable as they are and as Markdown."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

Row = tuple[str, ...]


@dataclass(frozen=True)
class Section:
    """One part's results. `notes` say what the figures are; the first row is the head of the table.

    `captions` are of the tables, in their order; a section of one table needs none.
    """

    part: str
    title: str
    notes: str
    tables: tuple[Sequence[Row], ...]
    captions: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Title, how to repeat it, notes, tables."""
        blocks = [f"## {self.title}", f"Repeat: `python benchmarks/run.py {self.part}`", self.notes]
        for number, rows in enumerate(self.tables):
            blocks += [f"### {caption}" for caption in self.captions[number : number + 1]]
            blocks.append(table(rows))
        return "\n\n".join(blocks)


def table(rows: Sequence[Row]) -> str:
    """`rows`, the head first, as a Markdown table with its columns in line."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    lines = [_line(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([lines[0], _line("-" * width for width in widths), *lines[1:]])


def machine() -> str:
    """What the figures depend on, in a line."""
    kernel = ".".join(platform.release().split(".")[:2])
    return f"{os.cpu_count()} cores, Python {platform.python_version()}, {platform.system()} {kernel}"


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"
