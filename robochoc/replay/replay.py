"""Replay: the protocol objects of a recorded run process its packets again.

A protocol is a pure state machine. Given the same packets, it must send the same messages again. If it does not, the
protocol has changed, or the journal was altered. All events of robots are compared except for their times: received
messages, decisions, incumbents, conclusions, sent messages and their sizes, NCCC clocks and constraint checks.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

import msgspec

from robochoc.communication.search_result import Progress
from robochoc.journal.events import Sent
from robochoc.journal.journal import Journal
from robochoc.model.outcome import Verdict
from robochoc.replay.claims import Contradiction, ReplayedRun, contradicted_claims, with_answer
from robochoc.replay.comparison import StepDifference
from robochoc.replay.rebuild import CannotReplayError, Rebuilder, ReplayOptions
from robochoc.replay.run_replay import ReplayStopsError, RunReplay
from robochoc.replay.steps import runs_of
from robochoc.system.lazy_dataclass import dataclass

PROGRESS_EVERY = 256
"""The number of steps between two progress reports."""


class StoppedRobot(msgspec.Struct, frozen=True, kw_only=True):
    """A robot that could be replayed only up to step `step` of run `run`, and the reason."""

    run: int
    robot: str
    step: int
    why: str


@dataclass(frozen=True)
class ReplayResult:
    """The result of a replay.

    Attributes:
        runs: The number of runs and epochs that were started.
        robots: The number of robots in these runs.
        steps: The number of steps that were replayed and found equal.
        messages: The number of messages sent in these steps.
        unfinished: The number of steps that are incomplete in the journal; their recorded part was compared.
        difference: The first difference; None if there is none.
        stopped: Robots that could not be replayed to the end.
        damage: The reason why the journal ends early; None if it does not.
        ended: True if the journal contains the end of the run.
        contradictions: Claims in the header and the outcome that differ from the results of the steps.
        truncated: True if the only damage is that the end of the journal is missing.
        decided_before: True if the run was decided without any step, because a robot has no solution by itself.
    """

    runs: int
    robots: int
    steps: int
    messages: int
    unfinished: int
    difference: StepDifference | None
    stopped: tuple[StoppedRobot, ...]
    damage: str | None
    ended: bool
    contradictions: tuple[Contradiction, ...] = ()
    truncated: bool = False
    decided_before: bool = False

    @property
    def identical(self) -> bool:
        """True if at least one step was replayed, and all steps were equal."""
        return self.steps > 0 and not self.differs

    @property
    def differs(self) -> bool:
        """True if there is a difference in the steps, or a contradiction."""
        return self.difference is not None or bool(self.contradictions)


def replay(
    journal: Journal, options: ReplayOptions | None = None, *, progress: Callable[[Progress], None] | None = None
) -> ReplayResult:
    """Replay a journal up to the first difference.

    Args:
        journal: The journal.
        options: Inputs besides the journal.
        progress: Called with the progress.

    Raises:
        CannotReplayError: if the robots cannot be rebuilt.
    """
    return _JournalReplay(journal, options or ReplayOptions(), progress).result()


class _JournalReplay:
    """A replay of all runs of one journal."""

    def __init__(self, journal: Journal, options: ReplayOptions, progress: Callable[[Progress], None] | None) -> None:
        self._journal = journal
        self._rebuilder = Rebuilder(journal.header, options)
        self._progress = progress
        self._began = time.monotonic()
        self._counts: dict[str, int] = {}
        self._steps = self._messages = self._unfinished = self._runs = 0
        self._stopped: list[StoppedRobot] = []
        self._played: list[ReplayedRun] = []
        self._stopped_robots: set[str] = set()
        """Robots whose state is no longer known."""

    def result(self) -> ReplayResult:
        difference = self._first_difference()
        found: Iterable[Contradiction] = ()
        if difference is None:
            is_complete = not (self._stopped or self._unfinished or self._journal.damage)
            found = contradicted_claims(self._journal, self._played, is_complete=is_complete)
        return ReplayResult(
            runs=self._runs,
            robots=len(self._counts),
            steps=self._steps,
            messages=self._messages,
            unfinished=self._unfinished,
            difference=difference,
            stopped=tuple(self._stopped),
            damage=self._journal.damage,
            ended=self._journal.outcome is not None,
            contradictions=tuple(found),
            truncated=self._journal.truncated,
            decided_before=_decided_before(self._journal),
        )

    def _first_difference(self) -> StepDifference | None:
        for run in runs_of(self._journal.events):
            self._show(f"run {run.number + 1}: creating the robots")
            robots = self._rebuilder.robots_of(run)
            if robots.protocol.traits.no_replay:
                raise CannotReplayError(robots.protocol.traits.no_replay)
            if robots.protocol.traits.secret_keys and self._journal.header.runtime == "network":
                raise CannotReplayError("its robots used random keys, which journals do not contain")
            self._runs += 1
            self._counts.update({name: 0 for name in robots.hosts if name not in self._counts})
            difference = self._play(RunReplay(run, robots, self._journal.header))
            if difference:
                return difference
            self._played.append(with_answer(run, robots, self._journal))
        return None

    def _play(self, replay: RunReplay) -> StepDifference | None:
        self._stopped_robots.intersection_update(replay.robots.continuing)
        for step in replay.steps():
            number = self._counts.get(step.robot, 0)
            self._counts[step.robot] = number + 1
            if step.robot in self._stopped_robots:
                continue
            try:
                difference = replay.play(step, number)
            except ReplayStopsError as stops:
                self._stopped_robots.add(step.robot)
                self._stopped.append(StoppedRobot(run=replay.run.number, robot=step.robot, step=number, why=str(stops)))
                continue
            if difference:
                return difference
            self._steps += 1
            if not step.is_complete:
                self._unfinished += 1
                self._stopped_robots.add(step.robot)
            self._messages += sum(isinstance(event, Sent) for event in step.done)
            if self._steps % PROGRESS_EVERY == 0:
                self._show()
        return None

    def _show(self, stage: str = "") -> None:
        if self._progress:
            self._progress(Progress(self._messages, time.monotonic() - self._began, stage))


def _decided_before(journal: Journal) -> bool:
    """Return whether the outcome was decided without a run, because a robot has no solution by itself."""
    outcome = journal.outcome
    if outcome is None or journal.events or journal.damage is not None or outcome.metrics.messages:
        return False
    return outcome.verdict == Verdict.NO_SOLUTION and bool(outcome.witness)
