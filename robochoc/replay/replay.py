"""Replay: the protocol objects of a recorded run process its packets again.

A protocol is a pure state machine. With the same packets it has to send the same messages again. If it does not, the
protocol has changed, or the journal was altered. Everything that robots report is compared but the time: what they took
in, decided, heard of and concluded, what they sent, with its size, their NCCC clocks and their constraint checks.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import msgspec

from robochoc.communication.search_result import Progress
from robochoc.journal.events import Sent
from robochoc.journal.journal import Journal
from robochoc.model.outcome import Verdict
from robochoc.replay.claims import Contradiction, ReplayedRun, contradicted_claims, with_answer
from robochoc.replay.comparison import Difference
from robochoc.replay.rebuild import CannotReplayError, Rebuilder, ReplayOptions
from robochoc.replay.run_replay import ReplayStopsError, RunReplay
from robochoc.replay.steps import runs_of

PROGRESS_EVERY = 256
"""Steps between two reports of progress."""


class StoppedRobot(msgspec.Struct, frozen=True, kw_only=True):
    """A robot that could be followed only up to step `step` of run `run`, and the reason."""

    run: int
    robot: str
    step: int
    why: str


@dataclass(frozen=True)
class ReplayResult:
    """The result of a replay.

    Attributes:
        runs: The number of runs and epochs that were begun.
        robots: The number of robots in them.
        steps: The number of steps that were replayed and found equal.
        messages: The number of messages sent in them.
        unfinished: The number of steps that are only in part in the journal; that part was compared.
        difference: The first difference; None: there is none.
        stopped: Robots that could not be followed to the end.
        damage: Why the journal ends early; None: it does not.
        ended: The journal holds the end of the run.
        contradictions: Claims of header and outcome that do not follow from the steps.
        truncated: The journal is damaged at its end only; it was not altered.
        decided_before: The run was decided before any robot began, as one has no solution by itself: there is no step.
    """

    runs: int
    robots: int
    steps: int
    messages: int
    unfinished: int
    difference: Difference | None
    stopped: tuple[StoppedRobot, ...]
    damage: str | None
    ended: bool
    contradictions: tuple[Contradiction, ...] = ()
    truncated: bool = False
    decided_before: bool = False

    @property
    def identical(self) -> bool:
        """Whether something was replayed, and all of it was equal."""
        return self.steps > 0 and not self.differs

    @property
    def differs(self) -> bool:
        """Whether there is a difference in the steps, or a contradiction."""
        return self.difference is not None or bool(self.contradictions)


def replay(
    journal: Journal, options: ReplayOptions | None = None, *, progress: Callable[[Progress], None] | None = None
) -> ReplayResult:
    """Replay a journal up to the first difference.

    Args:
        journal: The journal.
        options: Inputs besides the journal.
        progress: Is called with the progress.

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
        self._gone: set[str] = set()
        """Robots whose state is not known any more."""

    def result(self) -> ReplayResult:
        difference = self._first_difference()
        found: Iterable[Contradiction] = ()
        if difference is None:
            whole = not (self._stopped or self._unfinished or self._journal.damage)
            found = contradicted_claims(self._journal, self._played, whole=whole)
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

    def _first_difference(self) -> Difference | None:
        for run in runs_of(self._journal.events):
            self._show(f"run {run.number + 1}: making the robots")
            robots = self._rebuilder.robots_of(run)
            if robots.protocol.traits.secret_keys and self._journal.header.runtime == "network":
                raise CannotReplayError("its robots drew keys on their own machines, which no journal holds")
            self._runs += 1
            self._counts.update({name: 0 for name in robots.hosts if name not in self._counts})
            difference = self._play(RunReplay(run, robots, self._journal.header))
            if difference:
                return difference
            self._played.append(with_answer(run, robots, self._journal.outcome))
        return None

    def _play(self, replay: RunReplay) -> Difference | None:
        self._gone.intersection_update(replay.robots.continuing)
        for step in replay.steps():
            number = self._counts.get(step.robot, 0)
            self._counts[step.robot] = number + 1
            if step.robot in self._gone:
                continue
            try:
                difference = replay.play(step, number)
            except ReplayStopsError as stops:
                self._gone.add(step.robot)
                self._stopped.append(StoppedRobot(run=replay.run.number, robot=step.robot, step=number, why=str(stops)))
                continue
            if difference:
                return difference
            self._steps += 1
            if not step.whole:
                self._unfinished += 1
                self._gone.add(step.robot)
            self._messages += sum(isinstance(event, Sent) for event in step.done)
            if self._steps % PROGRESS_EVERY == 0:
                self._show()
        return None

    def _show(self, stage: str = "") -> None:
        if self._progress:
            self._progress(Progress(self._messages, time.monotonic() - self._began, stage))


def _decided_before(journal: Journal) -> bool:
    """Return whether the journal says that no robot began, as one of them alone has no solution."""
    outcome = journal.outcome
    if outcome is None or journal.events or journal.damage is not None or outcome.metrics.messages:
        return False
    return outcome.verdict == Verdict.NO_SOLUTION and bool(outcome.witness)
