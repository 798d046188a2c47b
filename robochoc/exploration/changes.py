"""Crashes, returns and events during the search, as in a run: each change of the problem opens the next epoch.

The epochs are those of a run (`run/scenario.py`), whose session only reports which robots were lost.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

from robochoc.communication.search_result import SearchResult
from robochoc.communication.session import Epoch, Session
from robochoc.generators.scenario import random_scenario
from robochoc.model.change import team_after_events
from robochoc.model.outcome import Verdict
from robochoc.model.problem import AddAgent, Robot, Team
from robochoc.model.team_edits import ChangeError
from robochoc.run.phases import RunPhase
from robochoc.run.scenario import FinishedEpoch, ScenarioRun
from robochoc.solver.compiled_team import CompiledTeam

CRASH = "its process was killed"
_ONE_CHANGE = 0.001
"""A rate of changes that gives one change per event."""


class Change(NamedTuple):
    """A change of the problem, which ends a stage and opens the next one.

    Attributes:
        in_words: The change in a few words.
        lost: The robots that crash; empty if the next event happens.
        back: Those of them that are restarted.
    """

    in_words: str = ""
    lost: tuple[str, ...] = ()
    back: tuple[str, ...] = ()


class FaultPlan(NamedTuple):
    """The maximum numbers of faults in one run.

    Attributes:
        crashes: The robots that crash and do not return.
        rejoins: The robots that crash and are restarted.
        events: The events, which change the problem.
    """

    crashes: int = 0
    rejoins: int = 0
    events: int = 0


def with_events(team: Team, events: int) -> Team:
    """Return `team` with at most `events` events: those in its scenario, or random ones."""
    if team.scenario:
        return replace(team, scenario=team.scenario[:events])
    if not events:
        return team
    changed = team
    with suppress(ValueError):  # no change is possible
        changed = random_scenario(team, events, _ONE_CHANGE, zlib.crc32(team.name.encode()))
    return replace(changed, name=team.name)


class Course(NamedTuple):
    """The possible courses of a run: the team with its scenario, the phase of the run, and the faults that may happen.

    The scenario is not a part of the problem that the robots solve.
    """

    team: Team
    phase: RunPhase
    plan: FaultPlan = FaultPlan()

    @property
    def start(self) -> Epoch:
        """The epoch before the first change."""
        return Epoch(CompiledTeam(team_after_events(self.team, 0)), parameters=self.phase.parameters)

    def after(self, changes: Sequence[Change]) -> FinishedEpoch | None:
        """Return the epoch after all of `changes`, as in a run; None if no robot is left."""
        epochs = self.run(changes).epochs(_UnsearchedSession(self.start.compiled, changes), lambda _: None)
        return next(itertools.islice(epochs, len(changes), None), None)

    def run(self, changes: Sequence[Change]) -> ScenarioRun:
        """Return a run, at its start, in which crashed robots return as in `changes`."""
        return _ChangingRun(self, changes)

    def may_follow(self, team: Team, changes: Sequence[Change]) -> Iterator[Change]:
        """Yield all that may happen to `team`, which results from `changes`."""
        back = sum(len(one.back) for one in changes)
        gone = sum(len(one.lost) for one in changes) - back
        if sum(not one.lost for one in changes) < min(self.plan.events, len(self.team.scenario)):
            yield Change()
        for returns in _subsets(team.order, self.plan.rejoins - back):
            rest = [name for name in team.order if name not in returns]
            for leaves in _subsets(rest, min(self.plan.crashes - gone, len(rest))):
                if returns or leaves:
                    yield Change("", (*leaves, *returns), returns)


def _subsets(names: Sequence[str], most: int) -> Iterator[tuple[str, ...]]:
    for size in range(most + 1):
        yield from itertools.combinations(names, size)


class _ChangingRun(ScenarioRun):
    """A run of a course, in which robots return as in `changes`."""

    def __init__(self, course: Course, changes: Sequence[Change]) -> None:
        team, parameters = course.team, course.phase.parameters
        spares = sum(len(one.lost) for one in changes)
        super().__init__(team, None, CompiledTeam, lambda: None, spares=spares, parameters=parameters)
        self._losses = iter([one for one in changes if one.lost])
        joining = [one.robot for event in team.scenario for one in event.changes if isinstance(one, AddAgent)]
        self._robots = {robot.name: robot for robot in (*team.robots, *joining)}
        self._back: Sequence[str] = ()

    def _lose(self, lost: Mapping[str, str]) -> Collection[str]:
        self._back = next(self._losses).back
        return super()._lose(lost)

    def _read_again(self, name: str) -> Robot:
        if name not in self._back:
            raise ChangeError(CRASH, "restart it")
        return self._robots[name]


class _UnsearchedSession(Session):
    """A session without robots: its searches end with `changes`."""

    lossless = True

    def __init__(self, compiled: CompiledTeam, changes: Sequence[Change]) -> None:
        super().__init__(compiled)
        self._left = iter(changes)

    def search(self, timeout: float | None = None, messages: int | None = None) -> SearchResult:  # noqa: ARG002
        """See `Session.search`."""
        lost = dict.fromkeys(next(self._left, Change()).lost, CRASH)
        return replace(SearchResult.of(Verdict.UNKNOWN, None, {}, (), 0), lost=lost)

    def change(self, epoch: Epoch) -> None:
        """See `Session.change`."""
        self.compiled = epoch.compiled

    def close(self) -> None:
        """See `Session.close`."""
