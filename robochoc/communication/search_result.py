"""The reports of a runtime: the progress and the result of a search."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import reduce
from operator import add
from typing import NamedTuple, Self

from robochoc.model.outcome import Metrics, Verdict
from robochoc.protocols.findings import Findings
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

_MOST_NAMED = 5


class RobotsLostError(RobochocError):
    """Raised if the loss of robots ends the run. `robots` maps the names of the lost robots to the reasons."""

    def __init__(self, robots: Mapping[str, str]) -> None:
        losses = [f"{name} was lost: {why}" for name, why in itertools.islice(robots.items(), _MOST_NAMED)]
        if len(robots) > _MOST_NAMED:
            losses.append(f"and {len(robots) - _MOST_NAMED} others were lost")
        super().__init__("; ".join(losses))
        self.robots = dict(robots)


class ClusterLostError(RobochocError):
    """The cluster that computes the run, or one of its workers, is lost."""


class Progress(NamedTuple):
    """The progress of a run: the number of messages sent so far, and the seconds since the start.

    `stage` names the current stage of the run if it is not a search.
    """

    messages: int
    elapsed_s: float
    stage: str = ""


@dataclass(frozen=True)
class SearchResult:
    """The result of a search by robots. `assignments` maps robots to the values of their variables (empty: no values).

    `witness` is the robot that concluded the verdict alone, or None if the verdict follows from quiescence or a limit.
    `lost` maps the robots whose loss stopped the search to the reasons. `findings` is the robots' knowledge about the
    team. `cycle_costs` contains the cost of the robots' values in each cycle, if the runtime has computed it, and
    `best_cycle` their values in the first of the cheapest cycles.
    """

    verdict: Verdict
    witness: str | None
    assignments: dict[str, dict[str, int]]
    metrics: Metrics
    lost: dict[str, str] = field(default_factory=dict)
    findings: dict[str, Findings] = field(default_factory=dict)
    cycle_costs: Sequence[float] = ()
    best_cycle: dict[str, dict[str, int]] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        verdict: Verdict,
        witness: str | None,
        assignments: Mapping[str, dict[str, int]],
        parts: Iterable[Metrics],
        wall_s: float,
    ) -> Self:
        """Combine the metrics of the robots: sums, except that NCCCs are the maximum of the robots' clocks."""
        parts = list(parts)
        total = reduce(add, parts, Metrics())
        ncccs = max((part.ncccs for part in parts), default=0)
        metrics = replace(total, ncccs=ncccs, wall_s=wall_s)
        return cls(verdict, witness, dict(assignments), metrics)
