"""A made-up session that loses robots."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.communication.search_result import SearchResult
from robochoc.communication.session import Epoch, Session
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import Team


class Losing(Session):
    """Each search loses the robots it is told to, or solves the problem. It sends seven messages."""

    def __init__(self, team: Team, losses: Sequence[str]) -> None:
        super().__init__(team)
        self._losses = list(losses)
        self.epochs: list[Epoch] = []
        self.limits: list[int | None] = []

    @property
    def lossless(self) -> bool:
        return True

    def search(self, timeout: float | None = None, messages: int | None = None) -> SearchResult:
        assert timeout is None
        self.limits.append(messages)
        lost = dict.fromkeys(self._losses.pop(0).split(), "was lost") if self._losses else {}
        verdict = Verdict.UNKNOWN if lost else Verdict.SOLUTION
        return SearchResult(verdict, None, {}, Metrics({"Ok": 7}), lost)

    def change(self, epoch: Epoch) -> None:
        self.compiled = epoch.compiled
        self.epochs.append(epoch)

    def close(self) -> None:
        """Nothing to close."""
