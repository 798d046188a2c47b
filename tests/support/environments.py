"""An environment that changes the problem as a test says, and what opened the epochs."""

from __future__ import annotations

from robochoc.model.outcome import EpochOutcome, Outcome
from robochoc.model.problem import ScenarioEvent, Team
from robochoc.run import Options, Runtime

SIMULATED = Options(protocol="dynabt", runtime=Runtime.SIMULATOR)


class Says:
    """An environment that says what it was told to say, and keeps what it is told."""

    def __init__(self, *events: ScenarioEvent | None) -> None:
        self.events = list(events)
        self.summary: list[tuple[tuple[str, ...], EpochOutcome, float | None]] = []

    def __call__(self, team: Team, epoch: EpochOutcome, left_s: float | None) -> ScenarioEvent | None:
        self.summary.append((team.order, epoch, left_s))
        return self.events.pop(0) if self.events else None


def openings(outcome: Outcome) -> list[str]:
    return [epoch.opened_by for epoch in outcome.epochs]
