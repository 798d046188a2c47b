"""What a run came to: the JSON result of `robochoc solve` (docs/reference/result.md), decoded."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import msgspec

from robochoc.app.sketch.sketch import Value
from robochoc.formats.result import MetricsForm, ResultForm


class RunResult(ResultForm, frozen=True, kw_only=True):
    """The JSON result of a team; fields that may be missing have defaults.

    Attributes:
        assignment: The values, by `ROBOT.DECISION`.
        cost: The cost, as a float where it is a decimal.
        bound: The lower bound of the cost, as a float where it is a decimal. None: not known.
        epochs: The epochs, if the problem has changed, as objects of the JSON result.
    """

    team: str = ""
    protocol: str = ""
    runtime: str = ""
    seed: int = 0
    assignment: dict[str, Value] = msgspec.field(default_factory=dict)
    cost: float | int | None = None  # type: ignore[assignment] # a decimal in a file may have millions of digits
    bound: float | int | None = None  # type: ignore[assignment] # likewise
    withdrawn: tuple[str, ...] = ()
    metrics: MetricsForm = MetricsForm(messages=0, bytes=0, ncccs=0, checks=0, wall_s=0)
    verified: bool = False
    epochs: tuple[dict[str, Any], ...] = ()  # type: ignore[assignment] # files of earlier versions may lack anything

    @property
    def messages(self) -> int:
        """How many messages were sent."""
        return self.metrics.messages

    @property
    def has_decided(self) -> bool:
        """Whether there is an answer in the end, or was one in an epoch before."""
        return bool(self.assignment) or self.ends_unsolved

    @property
    def ends_unsolved(self) -> bool:
        """Whether there was an answer before something happened, but is none any more."""
        return not self.assignment and any(map(_has_answer, self.epochs))

    def value(self, robot: str, decision: str) -> Value | None:
        """Return what a robot has decided."""
        return self.assignment.get(f"{robot}.{decision}")


def _has_answer(epoch: Mapping[str, Any]) -> bool:
    assignment = epoch.get("assignment")
    return isinstance(assignment, dict) and bool(assignment) and epoch.get("verdict") != "no-solution"


def robots_in(epoch: Mapping[str, Any]) -> list[str]:
    """Return who was there in an epoch of a result; nobody, if it does not say so."""
    robots = epoch.get("robots")
    return [*map(str, robots)] if isinstance(robots, list) else []


def decoded(content: bytes, labels: Mapping[str, str] = MappingProxyType({})) -> RunResult | None:
    """Return the result in what a run has written so far; None: there is none, or not all of it yet.

    Args:
        content: What it has written.
        labels: The user's own words for values, by what files say.
    """
    line, end, _ = content.partition(b"\n")
    try:
        result = msgspec.json.decode(line, type=RunResult) if end else None
    except (msgspec.MsgspecError, RecursionError):
        return None
    if result is None or not labels:
        return result
    own = {name: labels.get(str(value), value) for name, value in result.assignment.items()}
    return msgspec.structs.replace(result, assignment=own)
