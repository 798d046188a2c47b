"""What a run came to: the JSON result of `robochoc solve` (docs/reference/result.md), decoded."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import msgspec

from robochoc.app.sketch.sketch import Value


class Spent(msgspec.Struct, frozen=True):
    """What a run took."""

    messages: int = 0
    bytes: int = 0
    ncccs: int = 0
    wall_s: float = 0.0


class RunResult(msgspec.Struct, frozen=True):
    """The answer of a team.

    Attributes:
        verdict: `solution`, `optimal`, `no-solution` or `unknown`.
        protocol: The protocol that decided.
        runtime: Where the robots were.
        seed: The seed.
        assignment: The values, by `ROBOT.DECISION`.
        cost: What they cost. None: there are none.
        withdrawn: Who stepped aside.
        metrics: What it took.
        bound: No answer costs less. None: not known.
        reason: Why there is no verdict, and the like.
        order: The priority order, by its name.
        chosen: Why the protocol, and the order, were chosen.
        placed_by: The protocol that found out who steps aside, if it is another.
        epochs: One for each change of the problem, if there were some.
    """

    verdict: str
    protocol: str = ""
    runtime: str = ""
    seed: int = 0
    assignment: dict[str, Value] = {}
    cost: float | int | None = None
    withdrawn: tuple[str, ...] = ()
    metrics: Spent = Spent()
    bound: float | int | None = None
    reason: str | None = None
    order: str | None = None
    chosen: dict[str, str] = {}
    placed_by: str | None = None
    epochs: tuple[dict[str, Any], ...] = ()

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
