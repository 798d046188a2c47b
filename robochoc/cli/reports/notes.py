"""What reading a file of another tool has changed, for people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from robochoc.model.cost_units import Cost, cost_shown

if TYPE_CHECKING:
    from robochoc.formats.dialects.dialect import Note
    from robochoc.formats.problems import ReadProblem

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


def bound_told(problem: ReadProblem, cost: Cost | None) -> str:
    """Return what a cost means for the tool that the problem is from, if it reaches the bound there; or nothing."""
    if problem.bound is None or cost is None:
        return ""
    maximize = problem.team.robots[0].costs.maximize
    if cost > problem.bound if maximize else cost < problem.bound:
        return ""
    side = "above" if maximize else "below"
    return f"bound: a cost of {cost_shown(cost)} is not {side} the file's bound: there this is no solution"
