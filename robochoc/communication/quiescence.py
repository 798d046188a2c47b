"""Termination detection by four counters (Mattern, "Algorithms for distributed termination detection", 1987).

Every robot counts the protocol messages it has sent and those it has taken in (and finished with). If the sums
that a first wave collects equal those of a second one, begun after the first had ended, and as many were taken in
as were sent, then nothing was under way when the second wave began, and nothing ever will be. No timer is part of
the argument: slow messages only make it wait.

Pure: the runtime carries the waves. The first wave is the latest counters of each robot, whether it reported them
unasked or in answer to an earlier wave.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Counts(NamedTuple):
    """Protocol messages a robot has sent and has taken in so far."""

    sent: int
    received: int


class FourCounters:
    """The state of the one that asks: the latest counters, and the wave under way."""

    def __init__(self, robots: Iterable[str]) -> None:
        self._latest: dict[str, Counts | None] = dict.fromkeys(robots)
        self._unheard = len(self._latest)
        self._total = Counts(0, 0)
        self._wave = 0
        self._unanswered: set[str] = set()
        self._before: Counts | None = None
        self.quiescent = False

    @property
    def sent(self) -> int:
        """Messages sent, as far as reported."""
        return self._total.sent

    def hear(self, robot: str, counts: Counts) -> None:
        """Take in counters that `robot` reports unasked."""
        before = self._latest[robot]
        if before is None:
            self._unheard -= 1
            before = Counts(0, 0)
        self._latest[robot] = counts
        self._total = Counts(
            self._total.sent + counts.sent - before.sent, self._total.received + counts.received - before.received
        )

    @property
    def total(self) -> Counts | None:
        """Messages sent and received by all robots together; None while the counters of a robot are unknown."""
        return None if self._unheard else self._total

    def latest(self, robot: str) -> Counts | None:
        """Return the counters that `robot` has reported last; None if it has reported none."""
        return self._latest.get(robot)

    @property
    def silent(self) -> tuple[str, ...]:
        """The robots whose counters are unknown; else those that have not answered the wave under way."""
        unheard = [robot for robot, counts in self._latest.items() if counts is None]
        return tuple(sorted(unheard or self._unanswered))

    @property
    def due(self) -> bool:
        """Return whether a wave is due: all counters are known, the sums balance, and no wave is under way."""
        return not self._unanswered and not self._unheard and self._total.sent == self._total.received

    def begin_wave(self) -> int:
        """Open a wave and return its number, to be sent to every robot. Only when none is under way."""
        self._wave += 1
        self._unanswered = set(self._latest)
        self._before = None if self._unheard else self._total
        return self._wave

    @property
    def waving(self) -> bool:
        """Return whether a wave is under way."""
        return bool(self._unanswered)

    def answer(self, robot: str, wave: int, counts: Counts) -> None:
        """Take in `robot`'s answer to `wave`; the last one settles whether all is quiet."""
        self.hear(robot, counts)
        if wave != self._wave:
            return
        self._unanswered.discard(robot)
        if not self._unanswered:
            self.quiescent = self._total == self._before and self._total.sent == self._total.received
