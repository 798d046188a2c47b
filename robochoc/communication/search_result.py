"""The reports of a runtime: its progress, and the result of its search."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import add
from typing import NamedTuple, Self

from robochoc.model.outcome import Metrics, Verdict
from robochoc.protocols.findings import Findings
from robochoc.system.errors import RobochocError

_MOST_NAMED = 5


class RobotsLostError(RobochocError):
    """Robots were lost whose loss ends the run. `robots` maps their names to the reasons."""

    def __init__(self, robots: Mapping[str, str]) -> None:
        losses = [f"{name} was lost: {why}" for name, why in itertools.islice(robots.items(), _MOST_NAMED)]
        if len(robots) > _MOST_NAMED:
            losses.append(f"and {len(robots) - _MOST_NAMED} others were lost")
        super().__init__("; ".join(losses))
        self.robots = dict(robots)


class Progress(NamedTuple):
    """The progress of a run: messages sent so far, and seconds since its start.

    `stage` names the current work if it is not a search.
    """

    messages: int
    elapsed_s: float
    stage: str = ""


@dataclass(frozen=True)
class SearchResult:
    """The result of a search by robots. `assignments` maps each robot to its variables' values (empty: it has none).

    `witness` is the robot that concluded the verdict alone; None when it follows from quiescence or a limit. `lost`
    says why, by name, robots were lost whose loss broke the search off. `findings` is what robots know of the whole.
    """

    verdict: Verdict
    witness: str | None
    assignments: dict[str, dict[str, int]]
    metrics: Metrics
    lost: dict[str, str] = field(default_factory=dict)
    findings: dict[str, Findings] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        verdict: Verdict,
        witness: str | None,
        assignments: Mapping[str, dict[str, int]],
        parts: Iterable[Metrics],
        wall_s: float,
    ) -> Self:
        """Join the robots' metrics: sums, and for NCCCs the largest of their clocks."""
        parts = list(parts)
        total = reduce(add, parts, Metrics())
        ncccs = max((part.ncccs for part in parts), default=0)
        metrics = replace(total, ncccs=ncccs, wall_s=wall_s)
        return cls(verdict, witness, dict(assignments), metrics)
