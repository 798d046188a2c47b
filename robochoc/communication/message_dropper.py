"""Simulated message loss: robots drop arriving messages as if a radio link had lost them (`--message-loss`).

Between processes and over TCP no message is lost. So each receiver drops messages, each with the same probability,
drawn from the seed. Over a real radio link, sequence numbers would show the gaps; here the robot counts what it drops.
"""

from __future__ import annotations

import random
from collections import Counter

from robochoc.protocols.message import Envelope


class MessageDropper:
    """Draws the messages to a robot that are dropped, and counts them in `count`."""

    def __init__(self, probability: float, seed: int, robot: str) -> None:
        self._probability = probability
        self._chance = random.Random(f"dropped {seed} {robot}")  # noqa: S311 - a radio is no secret
        self._missing: Counter[str] = Counter()
        self.count = 0

    def drops(self, sender: str) -> bool:
        """Draw whether an arriving message from `sender` is dropped."""
        if self._chance.random() >= self._probability:
            return False
        self.count += 1
        self._missing[sender] += 1
        return True

    def missing_before(self, sender: str) -> int:
        """Return the number of messages from `sender` dropped since its last delivered message, and reset it."""
        return self._missing.pop(sender, 0)

    def missing(self, envelope: Envelope) -> int | None:
        """Return the number of messages dropped right before `envelope`, or None if `envelope` itself is dropped."""
        return None if self.drops(envelope.sender) else self.missing_before(envelope.sender)

    def mark_lossy(self) -> None:
        """Record at least one loss, because the robot's protocol could not continue and the result is unreliable."""
        self.count = max(self.count, 1)
