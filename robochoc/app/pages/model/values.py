"""The values of a decision as typed text: "1-5", "1, 2, 5", or names separated by commas."""

from __future__ import annotations

import re

from robochoc.app.sketch import sketch as limits
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.element_checks import MAX_NUMBER
from robochoc.app.sketch.sketch import NUMBERED, Decision, DecisionKind, Sketch

_RANGE = re.compile(r"(-?\d{1,9})\s*(?:-|\u2013|\.{2,3}|to)\s*(-?\d{1,9})", re.ASCII)
_NUMBER = re.compile(r"-?\d{1,9}", re.ASCII)
_FEW = 3
"""The minimum number of consecutive numbers written as a range."""


def typed_values(kind: DecisionKind, text: str) -> tuple[int | str, ...]:
    """Return the typed values without duplicates.

    Raises:
        EditError: if there are too many values, or they do not suit this kind of decision.
    """
    parts = [part.strip() for part in re.split(r"[,;\n]", text) if part.strip()]
    if len(parts) > limits.MAX_VALUES:
        raise EditError("edit.too-many-values", most=limits.MAX_VALUES)
    if kind not in NUMBERED:
        return tuple(dict.fromkeys(_checked_name(part) for part in parts))
    found: dict[int, None] = {}
    for part in parts:
        numbers = _numbers(part)
        if len(found) + len(numbers) > limits.MAX_VALUES:
            raise EditError("edit.too-many-values", most=limits.MAX_VALUES)
        found |= dict.fromkeys(numbers)
    return tuple(found)


def written_values(values: tuple[int | str, ...]) -> str:
    """Return values as text, in the form in which users type them."""
    parts: list[str] = []
    run: list[int] = []
    for value in values:
        if isinstance(value, int) and run and value == run[-1] + 1:
            run.append(value)
            continue
        parts += _run(run)
        run = [value] if isinstance(value, int) else []
        parts += [value] if isinstance(value, str) else []
    return ", ".join([*parts, *_run(run)])


def first_values(sketch: Sketch, kind: DecisionKind, names: str) -> tuple[int | str, ...]:
    """Return the initial values for a decision: a number for each robot, or some names."""
    if kind == DecisionKind.PLACE:
        return ()
    return tuple(range(1, max(len(sketch.robots), 3) + 1)) if kind in NUMBERED else typed_values(kind, names)


def free_decision_name(sketch: Sketch, stem: str) -> str:
    """Return an unused name for a decision: `slot`, `slot2`, ..."""
    taken = {decision.name for decision in sketch.decisions}
    numbered = (f"{stem}{number}" for number in range(2, len(taken) + 3))
    return next(name for name in (stem, *numbered) if name not in taken)


def with_cell(sketch: Sketch, decision: Decision, number: int) -> tuple[int | str, ...]:
    """Return the cells of a place after adding or removing a cell; empty means all free cells.

    Raises:
        EditError: if the last cell would be removed.
    """
    cells = {*sketch.values(decision)} ^ {number}
    if not cells:
        raise EditError("edit.last-cell", decision.name, decision=decision.name)
    return () if cells == {*sketch.area.free} else tuple(sorted(cell for cell in cells if isinstance(cell, int)))


def _numbers(part: str) -> range:
    if found := _RANGE.fullmatch(part):
        first, last = int(found[1]), int(found[2])
    elif _NUMBER.fullmatch(part):
        first = last = int(part)
    else:
        raise EditError("model.no-number", value=part[: limits.MAX_LABEL])
    if max(abs(first), abs(last)) > MAX_NUMBER:
        raise EditError("model.large-number", most=MAX_NUMBER)
    return range(min(first, last), max(first, last) + 1)


def _checked_name(part: str) -> str:
    if not part.isprintable() or len(part) > limits.MAX_LABEL:
        raise EditError("model.no-value-name", most=limits.MAX_LABEL)
    return part


def _run(numbers: list[int]) -> list[str]:
    return [f"{numbers[0]}-{numbers[-1]}"] if len(numbers) >= _FEW else [str(number) for number in numbers]
