"""Compares a team's decisions before and after a change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import StrEnum

from robochoc.app.runs.result import RunResult
from robochoc.app.sketch.building import decided
from robochoc.app.sketch.sentences import value_words
from robochoc.app.sketch.sketch import Decision, Sketch, Value
from robochoc.model.cost_units import Cost
from robochoc.modelling.model import Model
from robochoc.system.lazy_dataclass import dataclass

Values = Mapping[tuple[str, str], Value]
_SOLVED = frozenset({"solution", "optimal"})


class Fate(StrEnum):
    """The effect of a change on a robot's decision."""

    MOVED = "moved"
    SAME = "same"
    LEFT = "left"
    NEW = "new"
    OPEN = "open"
    """Not comparable, since there is no solution before or after the change."""


@dataclass(frozen=True)
class ComparisonRow:
    """A robot's decision before and after the change, in words; empty if there is none."""

    robot: str
    decision: str
    before: str
    after: str
    fate: Fate


@dataclass(frozen=True)
class TeamDecision:
    """The decision before or after the change.

    Attributes:
        verdict: The verdict.
        values: The values.
        cost: The cost, if there are costs.
        messages: The number of messages.
    """

    verdict: str
    values: Values
    cost: Cost | None
    messages: int

    @property
    def solved(self) -> bool:
        """True if there is an answer."""
        return self.verdict in _SOLVED


@dataclass(frozen=True)
class DecisionComparison:
    """Both decisions. `protocol` is the protocol after the change."""

    before: TeamDecision
    after: TeamDecision
    rows: tuple[ComparisonRow, ...]
    protocol: str

    @property
    def moved(self) -> list[str]:
        """The robots with a changed decision."""
        return [*dict.fromkeys(row.robot for row in self.rows if row.fate == Fate.MOVED)]

    @property
    def stayed(self) -> int:
        """The number of robots that are in the team before and after the change."""
        return len({row.robot for row in self.rows if row.fate not in {Fate.LEFT, Fate.NEW}})


def part_of(sketch: Sketch, model: Model | None, result: RunResult) -> TeamDecision:
    """Return the decision in a run. `model`: the solved model, if it is not the model of the sketch."""
    values = decided(sketch, result.values, model)
    return TeamDecision(result.verdict, values, result.cost, result.messages)


def parts_of_epochs(
    before: Sketch, after: Sketch, model: Model, result: RunResult
) -> tuple[TeamDecision, TeamDecision] | None:
    """Return the decisions in the two epochs of a run, or None if the run has only one epoch."""
    sketches = before, after
    if len(result.epochs) != len(sketches):
        return None
    one, other = (
        TeamDecision(
            epoch.verdict,
            decided(sketch, result.values_of(epoch), model),
            epoch.cost,
            sum(epoch.metrics.messages.values()),
        )
        for sketch, epoch in zip(sketches, result.epochs, strict=True)
    )
    return one, other


def compare(
    before: tuple[Sketch, TeamDecision], after: tuple[Sketch, TeamDecision], protocol: str
) -> DecisionComparison:
    """Compare both decisions. New robots are in the last rows."""
    rows = tuple(_rows(before, after))
    return DecisionComparison(before[1], after[1], rows, protocol)


def _rows(before: tuple[Sketch, TeamDecision], after: tuple[Sketch, TeamDecision]) -> Iterator[ComparisonRow]:
    names = [robot.name for sketch in (before[0], after[0]) for robot in sketch.robots]
    decisions = [*dict.fromkeys(one.name for sketch in (before[0], after[0]) for one in sketch.decisions)]
    for robot in dict.fromkeys(names):
        for decision in decisions:
            was, now = (_decision(sketch, robot, decision) for sketch in (before[0], after[0]))
            if was is None and now is None:
                continue
            old, new = (part.values.get((robot, decision)) for _, part in (before, after))
            yield ComparisonRow(
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
    """Return a robot's decision by name."""
    decision = sketch.decision(name)
    return decision if decision is not None and robot in sketch.deciders(decision) else None
