"""Termination detection by the four-counter method (Mattern, "Algorithms for distributed termination detection", 1987).

Every robot counts the protocol messages that it has sent, and those that it has received and handled. The first wave
collects these counts, and a second wave, started after the end of the first, collects them again. If both waves have
equal sums, and as many messages were received as sent, then no message was in transit when the second wave started,
and no message will ever be sent again. The argument needs no timer: slow messages only delay the detection.

Pure: the runtime transports the waves. The first wave consists of the latest counters of each robot, whether the robot
reported them unasked or in answer to an earlier wave.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class MessageCounts(NamedTuple):
    """The numbers of protocol messages that a robot has sent and received so far."""

    sent: int
    received: int


class FourCounters:
    """The state of the detection: the latest counters of each robot, and the open wave."""

    def __init__(self, robots: Iterable[str]) -> None:
        self._latest: dict[str, MessageCounts | None] = dict.fromkeys(robots)
        self._unreported = len(self._latest)
        self._total = MessageCounts(0, 0)
        self._wave = 0
        self._unanswered: set[str] = set()
        self._before: MessageCounts | None = None
        self.quiescent = False

    @property
    def sent(self) -> int:
        """The number of messages sent, according to the latest reports."""
        return self._total.sent

    def update(self, robot: str, counts: MessageCounts) -> None:
        """Record counters that `robot` reports unasked."""
        before = self._latest[robot]
        if before is None:
            self._unreported -= 1
            before = MessageCounts(0, 0)
        self._latest[robot] = counts
        self._total = MessageCounts(
            self._total.sent + counts.sent - before.sent, self._total.received + counts.received - before.received
        )

    @property
    def total(self) -> MessageCounts | None:
        """The numbers of messages sent and received by all robots; None while any robot's counters are unknown."""
        return None if self._unreported else self._total

    @property
    def counted(self) -> MessageCounts:
        """The numbers of messages sent and received, according to the latest reports."""
        return self._total

    @property
    def missing(self) -> int:
        """The number of messages that were sent and not received, according to the latest reports."""
        return self._total.sent - self._total.received

    def latest(self, robot: str) -> MessageCounts | None:
        """Return the latest counters of `robot`, or None if it has not reported any."""
        return self._latest.get(robot)

    @property
    def silent(self) -> tuple[str, ...]:
        """The robots whose counters are unknown. If all are known: the robots that have not answered the open wave."""
        unreported = [robot for robot, counts in self._latest.items() if counts is None]
        return tuple(sorted(unreported or self._unanswered))

    @property
    def wave(self) -> int:
        """The number of the latest wave; 0 before the first one."""
        return self._wave

    @property
    def due(self) -> bool:
        """True if a wave is due: all counters are known, the sums are equal, and no wave is open."""
        return not self._unanswered and not self._unreported and self._total.sent == self._total.received

    @property
    def is_changed(self) -> bool:
        """True if the sums differ from those before the latest wave, or some counters are unknown."""
        return bool(self._unreported) or self._total != self._before

    def start_wave(self) -> int:
        """Open a wave and return its number, which must be sent to every robot. Call only if no wave is open."""
        self._wave += 1
        self._unanswered = set(self._latest)
        self._before = None if self._unreported else self._total
        return self._wave

    @property
    def is_wave_open(self) -> bool:
        """True if some robots have not yet answered the latest wave."""
        return bool(self._unanswered)

    def close_wave(self) -> None:
        """Ignore all further answers to the open wave."""
        self._wave += self.is_wave_open
        self._unanswered = set()

    def answer(self, robot: str, wave: int, counts: MessageCounts) -> None:
        """Record `robot`'s answer to `wave`. After the last answer it is known whether the search is quiescent."""
        self.update(robot, counts)
        if wave != self._wave:
            return
        self._unanswered.discard(robot)
        if not self._unanswered:
            self.quiescent = self._total == self._before and self._total.sent == self._total.received
