"""Steps that have not ended or wait for received messages, and the channels of these messages."""

from __future__ import annotations

from collections import deque

from robochoc.journal.events import Sent


class PendingChannel:
    """The sent and not yet received messages from one robot to another, in one run.

    `owed` counts received messages whose sending has not been seen.
    """

    __slots__ = ("owed", "under_way")

    def __init__(self) -> None:
        self.under_way: deque[int] = deque()
        self.owed = 0


class PendingStep:
    """A step that has not ended, or waits for the sending of messages that it received."""

    __slots__ = ("checks", "clock", "decided", "notes", "packet", "received", "said", "t")

    def __init__(self) -> None:
        self.received: deque[PendingChannel] = deque()
        self.packet: list[int] = []
        self.decided: dict[str, int] | None = None
        self.notes: list[tuple[float, str, str]] = []
        self.said: list[Sent] = []
        self.t = 0.0
        self.clock = self.checks = 0

    def taken_in(self) -> bool:
        """Return whether all received messages are known; move the known ones to the step's packet."""
        while self.received:
            if not self.received[0].under_way:
                return False
            self.packet.append(self.received.popleft().under_way.popleft())
        return True
