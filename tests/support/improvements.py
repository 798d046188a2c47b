"""Teams and options for `--improve`, and an audience that checks what it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.run import Options, Runtime
from robochoc.verification.checker import assignment_cost, violations
from tests.support.brute_force import least_cost

LONG = {"cycles": "100000"}
FOUND = {Verdict.SOLUTION, Verdict.OPTIMAL}


class Told:
    """An audience that keeps all that it is told, and checks it by itself."""

    def __init__(self, news_at: int | None = None) -> None:
        self.heard: list[tuple[Team, EpochOutcome, tuple[str, ...]]] = []
        self._news_at = news_at

    def improve(self, team: Team, /, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        assert list(violations(team, epoch.assignment, withdrawn)) == []
        assert epoch.cost is not None
        assert epoch.verified
        self.heard.append((team, epoch, tuple(withdrawn)))

    def has_news(self, _team: Team) -> bool:
        return self._news_at is not None and len(self.heard) >= self._news_at

    @property
    def costs(self) -> list[float]:
        return [float(epoch.cost or 0) for _, epoch, _ in self.heard]


def costly(size: int = 8, **more: object) -> Team:
    return random_csp(size, 4, 0.6, 0, 1, max_cost=50, **more)  # type: ignore[arg-type]


def simulated(protocol: str, deadline: float, improve: float, **more: object) -> Options:
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, deadline=deadline, improve=improve)
    return replace(options, **more)  # type: ignore[arg-type]


def agreed(team: Team, outcome: Outcome, told: Told) -> None:
    """Check what was published against each other, against the outcome, and against brute force."""
    assert told.costs == sorted(set(told.costs), reverse=True)
    best = least_cost(team)
    for _, epoch, withdrawn in told.heard:
        assert epoch.cost == assignment_cost(team, epoch.assignment)
        assert not withdrawn
        assert epoch.cost >= best
    if told.heard:
        last = told.heard[-1][1]
        assert (outcome.assignment, outcome.cost) == (last.assignment, last.cost)
        assert outcome.verdict in FOUND
    assert [one.cost for one in outcome.improvements] == told.costs[len(told.costs) - len(outcome.improvements) :]
    if outcome.verdict is Verdict.OPTIMAL:
        assert (outcome.cost, outcome.deadline, outcome.bound) == (best, None, None)
    if outcome.verdict is Verdict.NO_SOLUTION:
        assert best == INFINITE
    if outcome.bound is not None and best < INFINITE:
        assert outcome.bound <= best


class Watcher(Told):
    """An audience for which the first answer is enough."""

    def __init__(self, told: Told) -> None:
        super().__init__(news_at=1)
        self.heard = told.heard
