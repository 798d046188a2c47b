"""Messages that a robot drops on purpose when they arrive, as a radio would have lost them (`--message-loss`).

Where robots are processes, nothing is lost on the way: pipes and TCP see to that. So each robot loses at its end what
it receives, each message with the same probability, drawn from the seed. Numbers on the messages would show which are
missing; here the robot counts what it drops.
"""

from __future__ import annotations

import random
from collections import Counter

from robochoc.model.message import Envelope


class Dropped:
    """Draws which messages of a robot are dropped. `many` counts them."""

    def __init__(self, probability: float, seed: int, robot: str) -> None:
        self._probability = probability
        self._chance = random.Random(f"dropped {seed} {robot}")  # noqa: S311 - a radio is no secret
        self._missing: Counter[str] = Counter()
        self.many = 0

    def takes(self, sender: str) -> bool:
        """Return whether a message of `sender`, which has arrived, is dropped."""
        if self._chance.random() >= self._probability:
            return False
        self.many += 1
        self._missing[sender] += 1
        return True

    def before(self, sender: str) -> int:
        """Return how many messages of `sender` were dropped right before the one that has arrived. Ask once."""
        return self._missing.pop(sender, 0)

    def missing(self, envelope: Envelope) -> int | None:
        """Return how many messages were dropped right before `envelope`, which arrives; None: it is dropped, too."""
        return None if self.takes(envelope.sender) else self.before(envelope.sender)

    def refuse(self) -> None:
        """Count the message that the robot's protocol could not use, if it is the first one that gets lost here.

        So nobody relies on what a search has found in which a robot could not go on, wherever the loss was.
        """
        self.many = max(self.many, 1)
