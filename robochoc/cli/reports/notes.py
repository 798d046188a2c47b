"""What reading a file of another tool has changed, for people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robochoc.formats.dialects.dialect import Note

_SHOWN = 3
"""The notes of one kind that are shown."""


def notes_told(notes: Iterable[Note], more: str) -> Iterator[str]:
    """Yield a line for each note.

    Args:
        notes: The notes.
        more: Where all of them stand: of many of one kind, the first are told.
    """
    from robochoc.formats import on_one_line

    kinds: dict[str, list[str]] = {}
    for note in notes:
        kinds.setdefault(note.kind, []).append(note.text)
    for kind, texts in kinds.items():
        for text in texts[:_SHOWN]:
            yield on_one_line(f"  {kind}: {text}")
        if len(texts) > _SHOWN:
            yield f"  {kind}: and {len(texts) - _SHOWN:,} more ({more})"


def differences_told(notes: Iterable[Note]) -> Iterator[str]:
    """Yield a line for each note on what the team says otherwise than the file."""
    from robochoc.formats.dialects.dialect import OTHER_PROBLEM

    return notes_told((note for note in notes if note.kind in OTHER_PROBLEM), "'robochoc import --report' lists them")
