"""What a change comes to: who decides something else now, and what it has cost to find out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from robochoc.app.runs.result import RunResult
from robochoc.app.sketch.building import decided
from robochoc.app.sketch.sketch import Decision, Sketch, Value
from robochoc.app.sketch.words import value_words
from robochoc.modelling.model import Model

Values = Mapping[tuple[str, str], Value]
_SOLVED = frozenset({"solution", "optimal"})


class Fate(StrEnum):
    """What becomes of a robot's decision."""

    MOVED = "moved"
    SAME = "same"
    LEFT = "left"
    NEW = "new"
    OPEN = "open"
    """There is nothing to compare: no solution, before or after."""


@dataclass(frozen=True)
class Row:
    """A decision of a robot, before and after, in words. Empty: there is none."""

    robot: str
    decision: str
    before: str
    after: str
    fate: Fate


@dataclass(frozen=True)
class Part:
    """What was decided before the change, or after it.

    Attributes:
        verdict: How it ended.
        values: What was decided.
        cost: What it costs, where there are costs.
        messages: How many messages it took.
    """

    verdict: str
    values: Values
    cost: float | int | None
    messages: int

    @property
    def solved(self) -> bool:
        """Whether there is an answer."""
        return self.verdict in _SOLVED


@dataclass(frozen=True)
class Outcome:
    """Both parts, side by side. `protocol` decided after the change."""

    before: Part
    after: Part
    rows: tuple[Row, ...]
    protocol: str

    @property
    def moved(self) -> list[str]:
        """Who decides something else than before."""
        return [*dict.fromkeys(row.robot for row in self.rows if row.fate == Fate.MOVED)]

    @property
    def stayed(self) -> int:
        """How many robots there are before and after."""
        return len({row.robot for row in self.rows if row.fate not in {Fate.LEFT, Fate.NEW}})


def part_of(sketch: Sketch, model: Model | None, result: RunResult) -> Part:
    """Return what a run came to. `model`: the one that was solved, if it is not the sketch's own."""
    values = decided(sketch, result.assignment, model)
    return Part(result.verdict, values, result.cost, result.messages)


def parts_of_epochs(before: Sketch, after: Sketch, model: Model, result: RunResult) -> tuple[Part, Part] | None:
    """Return what was decided in both epochs of a run; None: it did not come so far."""
    sketches = before, after
    if len(result.epochs) != len(sketches):
        return None
    one, other = (_of_epoch(sketch, model, epoch) for sketch, epoch in zip(sketches, result.epochs, strict=True))
    return one, other


def outcome(before: tuple[Sketch, Part], after: tuple[Sketch, Part], protocol: str) -> Outcome:
    """Return both parts, side by side: first the robots that were there, then those that have come."""
    rows = tuple(_rows(before, after))
    return Outcome(before[1], after[1], rows, protocol)


def _of_epoch(sketch: Sketch, model: Model, epoch: Mapping[str, Any]) -> Part:
    values = decided(sketch, epoch.get("assignment", {}), model)
    cost = epoch.get("cost")
    number = cost if isinstance(cost, int | float) else None
    return Part(str(epoch.get("verdict")), values, number, int(epoch.get("messages", 0)))


def _rows(before: tuple[Sketch, Part], after: tuple[Sketch, Part]) -> Iterator[Row]:
    names = [robot.name for sketch in (before[0], after[0]) for robot in sketch.robots]
    decisions = [*dict.fromkeys(one.name for sketch in (before[0], after[0]) for one in sketch.decisions)]
    for robot in dict.fromkeys(names):
        for decision in decisions:
            was, now = (_decision(sketch, robot, decision) for sketch in (before[0], after[0]))
            if was is None and now is None:
                continue
            old, new = (part.values.get((robot, decision)) for _, part in (before, after))
            yield Row(
                robot,
                decision,
                value_words(before[0], was, old) if was and old is not None else "",
                value_words(after[0], now, new) if now and new is not None else "",
                _fate(was, now, old, new),
            )


def _fate(was: Decision | None, now: Decision | None, old: Value | None, new: Value | None) -> Fate:
    if now is None:
        return Fate.LEFT
    if was is None:
        return Fate.NEW
    if old is None or new is None:
        return Fate.OPEN
    return Fate.SAME if old == new else Fate.MOVED


def _decision(sketch: Sketch, robot: str, name: str) -> Decision | None:
    """Return a decision that a robot takes."""
    decision = sketch.decision(name)
    return decision if decision is not None and robot in sketch.deciders(decision) else None
