"""Messages that are permanently lost in transit, each with the same probability, drawn from a seed.

The next message in the same channel reveals the gap to the receiver, as sequence numbers would. If no message follows,
robots notice the loss when no more messages arrive.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Mapping

from robochoc.model.problem import Team
from robochoc.protocols.message import Envelope

Link = tuple[str, str]
"""The sender and the receiver."""


class Losses:
    """Draws lost messages, and counts them in `lost`."""

    def __init__(self, probability: float, seed: int) -> None:
        self._probability = probability
        self._chance = random.Random(f"losses {seed}")  # noqa: S311 - a radio is no secret
        self.lost = 0
        self._missing: dict[Link, int] = {}
        """For each channel, the number of messages lost since its last message that was not lost."""
        self._under_way: dict[Link, deque[int]] = {}
        """For each channel, the numbers of messages lost right before each message in transit."""

    def follow(self, team: Team, values_of: Callable[[str], Mapping[str, int]]) -> None:
        """Use this `team` from now on. `values_of` returns a robot's current values."""

    def _loss_of(self, link: Link) -> float:  # noqa: ARG002 - the same for all links
        """Return the probability that the next message on `link` is lost. Called once per message."""
        return self._probability

    def loses(self, envelope: Envelope) -> bool:
        """Draw whether `envelope`, which is being sent, gets lost."""
        edge = (envelope.sender, envelope.receiver)
        if self._chance.random() < self._loss_of(edge):
            self.lost += 1
            self._missing[edge] = self._missing.get(edge, 0) + 1
            return True
        self._under_way.setdefault(edge, deque()).append(self._missing.pop(edge, 0))
        return False

    def missing_before(self, envelope: Envelope) -> int:
        """Return the number of messages lost right before `envelope` in its channel. Called once, when it arrives."""
        return self._under_way[envelope.sender, envelope.receiver].popleft()

    def reset(self) -> int:
        """Reset the state at the end of a search, and return the number of messages lost in that search."""
        lost, self.lost = self.lost, 0
        self._missing.clear()
        self._under_way.clear()
        return lost
