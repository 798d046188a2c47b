"""Watching a search: the watcher receives snapshots of the robots' values while the robots continue."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping

from robochoc.communication.control import RobotSnapshot
from robochoc.communication.search_result import SearchResult
from robochoc.model.outcome import Metrics, Verdict
from robochoc.protocols.findings import Findings
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class SearchWatch(ABC):
    """Watches a search. Runtimes call `wants_snapshot` from time to time, and `receive` with each snapshot."""

    @property
    @abstractmethod
    def satisfied(self) -> bool:
        """True if the search may stop."""

    @abstractmethod
    def wait_s(self, now: float) -> float:
        """Return the seconds until the next call of `wants_snapshot`; `now` is on the monotonic clock."""

    @abstractmethod
    def wants_snapshot(self, now: float) -> bool:
        """Do the work that is due, and return whether a snapshot is needed now."""

    @abstractmethod
    def receive(self, snapshot: SearchResult) -> None:
        """Receive a snapshot. Its verdict is `unknown`, because the search continues."""


class SnapshotRound:
    """Collects the robots' answers to `TakeSnapshot`, for one snapshot number at a time."""

    def __init__(self) -> None:
        self.number = 0
        self._open = False
        self._answers: dict[str, RobotSnapshot] = {}

    def open(self) -> int | None:
        """Open a round and return its number, or None if another round is open."""
        if self._open:
            return None
        self._open, self._answers = True, {}
        self.number += 1
        return self.number

    def add(self, name: str, answer: RobotSnapshot) -> str:
        """Add the answer from the robot `name`. Return the reason why the answer is invalid, or an empty text."""
        if not self._open or answer.number != self.number or name in self._answers:
            return "it sent a snapshot that was not requested"
        self._answers[name] = answer
        return ""

    def close(self, present: Iterable[str]) -> SearchResult | None:
        """Close the round and return its snapshot if all robots in `present` have answered; otherwise return None."""
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
) -> SearchResult:
    """Return a snapshot of the robots' values and findings, as a search result without a verdict."""
    metrics = Metrics(lost_messages=lost_messages)
    return SearchResult(Verdict.UNKNOWN, None, dict(assignments), metrics, findings=dict(findings))
