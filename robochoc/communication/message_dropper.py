"""Simulated message loss: a robot drops messages when they arrive, as a radio would have lost them (`--message-loss`).

Between processes and over TCP no message is lost. So each receiver drops messages, each with the same probability,
drawn from the seed. Real messages would have sequence numbers that show the gaps; here the robot counts what it drops.
"""

from __future__ import annotations

import random
from collections import Counter

from robochoc.protocols.message import Envelope


class MessageDropper:
    """Draws which messages to a robot are dropped, and counts them in `count`."""

    def __init__(self, probability: float, seed: int, robot: str) -> None:
        self._probability = probability
        self._chance = random.Random(f"dropped {seed} {robot}")  # noqa: S311 - a radio is no secret
        self._missing: Counter[str] = Counter()
        self.count = 0

    def drops(self, sender: str) -> bool:
        """Return whether a message of `sender` that has arrived is dropped."""
        if self._chance.random() >= self._probability:
            return False
        self.count += 1
        self._missing[sender] += 1
        return True

    def missing_before(self, sender: str) -> int:
        """Return the number of messages of `sender` dropped since its last one that was not, and reset it."""
        return self._missing.pop(sender, 0)

    def missing(self, envelope: Envelope) -> int | None:
        """Return the number of messages dropped right before `envelope`; None if `envelope` is dropped, too."""
        return None if self.drops(envelope.sender) else self.missing_before(envelope.sender)

    def mark_lossy(self) -> None:
        """Count at least one loss, as the robot's protocol could not continue and the result is not reliable."""
        self.count = max(self.count, 1)
