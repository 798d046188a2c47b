"""Named tuples in CSV files: what was measured, kept as it was."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple, TypeVar, get_type_hints

R = TypeVar("R", bound=NamedTuple)


def read_rows(path: Path, kind: type[R]) -> list[R]:
    """All rows of `path`, as `kind`; none when there is no such file."""
    if not path.exists():
        return []
    types = list(get_type_hints(kind).values())
    with path.open(newline="") as file:
        lines = list(csv.reader(file))
    return [kind(*(type_(cell) for type_, cell in zip(types, line, strict=True))) for line in lines[1:]]


def append_row(path: Path, row: NamedTuple) -> None:
    """Add `row` to `path`, after a head if it is the first."""
    begun = path.exists()
    with path.open("a", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        if not begun:
            out.writerow(row._fields)
        out.writerow(row)


def written_rows(path: Path, kind: type[R], rows: Iterable[R]) -> None:
    """Write `path` anew."""
    with path.open("w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(kind._fields)
        out.writerows(rows)
