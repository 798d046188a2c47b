"""Watching a search while it goes on: at times the watcher gets what the robots have, and they search on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping

from robochoc.communication.control import Snapshot
from robochoc.communication.run_result import RunResult
from robochoc.model.outcome import Metrics, Verdict
from robochoc.protocols.findings import Findings
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class SearchWatch(ABC):
    """Watches a search. Runtimes call `wants_snapshot` now and then, and `take` with each snapshot."""

    @property
    @abstractmethod
    def satisfied(self) -> bool:
        """Return whether the search need not go on."""

    @abstractmethod
    def wait_s(self, now: float) -> float:
        """Return in how many seconds `wants_snapshot` should be called; `now` is on the monotonic clock."""

    @abstractmethod
    def wants_snapshot(self, now: float) -> bool:
        """Do what is due, and return whether a snapshot is to be taken now."""

    @abstractmethod
    def take(self, snapshot: RunResult) -> None:
        """Take in a snapshot. Its verdict is `unknown`, as the search goes on."""


class SnapshotRound:
    """The answers of robots to `TakeSnapshot`, one number after the other."""

    def __init__(self) -> None:
        self.number = 0
        self._open = False
        self._answers: dict[str, Snapshot] = {}

    def begin(self) -> int | None:
        """Return the number of a round that begins; None while another one goes on."""
        if self._open:
            return None
        self._open, self._answers = True, {}
        self.number += 1
        return self.number

    def add(self, name: str, answer: Snapshot) -> str:
        """Add the answer of the robot `name`; return what is wrong with it, or an empty text."""
        if not self._open or answer.number != self.number or name in self._answers:
            return "it was not asked what it has"
        self._answers[name] = answer
        return ""

    def end(self, present: Iterable[str]) -> RunResult | None:
        """Return the snapshot, and end the round, once all robots that are `present` have answered; else None."""
        if not self._open or not self._answers.keys() >= set(present):
            return None
        self._open = False
        answers = self._answers
        return snapshot_of(
            {name: one.assignment for name, one in answers.items()},
            {name: one.findings for name, one in answers.items()},
            sum(one.lost for one in answers.values()),
        )


def snapshot_of(
    assignments: Mapping[str, dict[str, int]], findings: Mapping[str, Findings], lost_messages: int = 0
) -> RunResult:
    """Return what robots have at a moment, by their names, as the result of a search that has no verdict."""
    metrics = Metrics(lost_messages=lost_messages)
    return RunResult(Verdict.UNKNOWN, None, dict(assignments), metrics, findings=dict(findings))
