"""The cost of some runs together, to compare protocols and settings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, ScheduleName, solve


class Spent(NamedTuple):
    """Messages by type, and all of them; and non-concurrent constraint checks."""

    messages: int
    ncccs: int
    by_type: Counter[str]


def spent(
    teams: Iterable[Team], protocol: str, schedule: ScheduleName = ScheduleName.CONCURRENT, **settings: str
) -> Spent:
    """Return the sums over a run of `protocol` in the simulator for each of `teams`."""
    by_type, ncccs = Counter[str](), 0
    for team in teams:
        options = Options(
            protocol=protocol, runtime=Runtime.SIMULATOR, schedule=schedule, settings=settings, cache=False
        )
        metrics = solve(team, options).metrics
        by_type.update(metrics.messages)
        ncccs += metrics.ncccs
    return Spent(by_type.total(), ncccs, by_type)
