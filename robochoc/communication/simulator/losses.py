"""Messages that are lost on their way, for good: each with the same probability, drawn from a seed.

The next message of the same channel shows its receiver that some are missing, as numbers on messages would. Where none
follows, robots notice when nothing arrives any more.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Mapping

from robochoc.model.message import Envelope
from robochoc.model.problem import Team

Link = tuple[str, str]
"""Sender and receiver."""


class Losses:
    """Draws which messages are lost. `lost` counts them."""

    def __init__(self, probability: float, seed: int) -> None:
        self._probability = probability
        self._chance = random.Random(f"losses {seed}")  # noqa: S311 - a radio is no secret
        self.lost = 0
        self._missing: dict[Link, int] = {}
        """By channel, the messages lost since the last one that was not."""
        self._under_way: dict[Link, deque[int]] = {}
        """By channel, for each message under way how many were lost right before it."""

    def follow(self, team: Team, values_of: Callable[[str], Mapping[str, int]]) -> None:
        """Know the `team` from now on, and the values that a robot has at any time."""

    def _loss_of(self, link: Link) -> float:  # noqa: ARG002 - the same for all links
        """Return the probability that the next message of `link` is lost. Ask once for each message."""
        return self._probability

    def takes(self, envelope: Envelope) -> bool:
        """Return whether `envelope`, which is being sent, will never arrive."""
        edge = (envelope.sender, envelope.receiver)
        if self._chance.random() < self._loss_of(edge):
            self.lost += 1
            self._missing[edge] = self._missing.get(edge, 0) + 1
            return True
        self._under_way.setdefault(edge, deque()).append(self._missing.pop(edge, 0))
        return False

    def before(self, envelope: Envelope) -> int:
        """Return how many messages of its channel were lost right before `envelope`, which has arrived. Ask once."""
        return self._under_way[envelope.sender, envelope.receiver].popleft()

    def end(self) -> int:
        """End a search: nothing is under way any more. Return how many messages were lost in it."""
        lost, self.lost = self.lost, 0
        self._missing.clear()
        self._under_way.clear()
        return lost
