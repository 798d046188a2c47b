"""The JSON result of a run (docs/reference/result.md), with the user's values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property
from types import MappingProxyType

from robochoc.app.sketch.sentences import listed
from robochoc.app.sketch.sketch import Value
from robochoc.app.texts import say
from robochoc.formats.result import ResultError, read_result
from robochoc.model.cost_units import cost_shown
from robochoc.model.outcome import Answer, Outcome, Verdict
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True, kw_only=True)
class RunResult(Outcome):
    """The result of a run.

    Attributes:
        labels: The user's words for values, by their names in files.
        point: The index of the point of the Pareto front whose values and costs this result has.
    """

    labels: Mapping[str, str] = field(default_factory=dict, compare=False)
    point: int = 0

    @property
    def messages(self) -> int:
        """The number of messages sent."""
        return sum(self.metrics.messages.values())

    @property
    def has_decided(self) -> bool:
        """True if there is an answer at the end, or was an answer in an earlier epoch."""
        return bool(self.assignment) or self.ends_unsolved

    @property
    def ends_unsolved(self) -> bool:
        """True if there was an answer before an event, but is none at the end."""
        return not self.assignment and any(
            epoch.assignment and epoch.verdict != Verdict.NO_SOLUTION for epoch in self.epochs
        )

    @cached_property
    def values(self) -> dict[str, Value]:
        """The user's values, by `ROBOT.DECISION`."""
        return self.values_of(self)

    def values_of(self, answer: Answer) -> dict[str, Value]:
        """Return the user's values in this result, or in one of its epochs, by `ROBOT.DECISION`."""
        named = self.labelled(answer.assignment)
        shown = {name: str(value) if isinstance(value, float) else value for name, value in named.items()}
        return {name: self.labels.get(str(value), value) for name, value in shown.items()}

    def at_point(self, place: int) -> RunResult:
        """Return this result with the values and costs of the point at this index of its front, if there is one."""
        if not 0 <= place < len(self.front):
            return self
        point = self.front[place]
        cost = next(iter(point.objectives.values()), None)
        return replace(self, assignment=point.assignment, objectives=point.objectives, cost=cost, point=place)

    @property
    def point_in_words(self) -> str:
        """The chosen point of the Pareto front with its costs, as a sentence; empty if there is no front."""
        if not self.front:
            return ""
        costs = listed([f"{name} {cost_shown(cost)}" for name, cost in self.objectives.items()])
        return say("decide.point", number=self.point + 1, points=f"{len(self.front):,}", costs=costs)

    def value(self, robot: str, decision: str) -> Value | None:
        """Return the value that a robot chose for a decision."""
        return self.values.get(f"{robot}.{decision}")


def decoded(content: bytes, labels: Mapping[str, str] = MappingProxyType({})) -> RunResult | None:
    """Return the result in the output of a run, or None if there is no result or it is still incomplete.

    Args:
        content: The output.
        labels: The user's words for values, by their names in files.
    """
    line, end, _ = content.partition(b"\n")
    try:
        outcome = read_result(line) if end else None
    except ResultError:
        return None
    return None if outcome is None else RunResult(**outcome.parts(Outcome), labels=labels)
