"""Problems of other tools in a folder and below: which files, and which belong together."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from robochoc.formats.dialects.registry import beginning_of, dialect_called, recognise
from robochoc.model.priorities import natural_key


def problems_below(folder: Path, name: str | None = None) -> Iterator[tuple[Path, list[Path]]]:
    """Yield each problem in `folder` and below: where its team belongs, relative to another folder, and its files.

    Files of no known format, hidden files and symbolic links to folders are passed over.

    Args:
        folder: The folder.
        name: The name of the dialect that all files are in. None: it is recognised.
    """
    for place, below, names in os.walk(folder):
        below[:] = sorted((one for one in below if not one.startswith(".")), key=natural_key)
        here = Path(place)
        files = [here / one for one in sorted(names, key=natural_key) if not one.startswith(".")]
        whole, parts = _split(files, name)
        relative = here.relative_to(folder)
        taken: set[str] = set()
        for file in whole:
            stem = file.stem if file.stem not in taken else file.name.replace(".", "-")
            taken.add(stem)
            yield relative / stem, [file]
        if parts:
            alone = not whole and not below
            yield relative if alone else relative / f"{here.resolve().name}-agents", parts


def _split(files: list[Path], name: str | None) -> tuple[list[Path], list[Path]]:
    """Return the files that are a problem each, and those that are parts of one."""
    whole: list[Path] = []
    parts: list[Path] = []
    for file in files:
        dialect = dialect_called(name) if name else recognise(file)
        beginning = beginning_of(file)
        if dialect is None or beginning is None:
            continue
        (parts if dialect.is_part and dialect.is_part(file, beginning) else whole).append(file)
    return whole, parts
