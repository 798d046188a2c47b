"""Notes on problems of other tools: the changes made by the import, and a cost bound."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from robochoc.model.cost_units import Cost, cost_shown

if TYPE_CHECKING:
    from robochoc.formats.dialects.dialect import ConversionNote
    from robochoc.formats.problems import ReadProblem

_SHOWN = 3
"""The maximum number of notes shown of each kind."""


def note_lines(notes: Iterable[ConversionNote], more: str) -> Iterator[str]:
    """Yield a line for each note, up to three of each kind.

    Args:
        notes: The notes.
        more: A hint on where to find all notes.
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


def difference_lines(notes: Iterable[ConversionNote]) -> Iterator[str]:
    """Yield a line for each note about a difference between the team and the file."""
    notes = list(notes)
    if not notes:
        return iter(())
    from robochoc.formats.dialects.dialect import OTHER_PROBLEM

    return note_lines((note for note in notes if note.kind in OTHER_PROBLEM), "'robochoc import --report' lists them")


def bound_warning(problem: ReadProblem, cost: Cost | None) -> str:
    """Return a warning if a cost reaches the bound in the problem's file, and so is not a solution; else empty."""
    if problem.bound is None or cost is None:
        return ""
    maximize = problem.team.robots[0].costs.maximize
    if cost > problem.bound if maximize else cost < problem.bound:
        return ""
    side = "above" if maximize else "below"
    return f"bound: a cost of {cost_shown(cost)} is not {side} the file's bound: by the file this is not a solution"
