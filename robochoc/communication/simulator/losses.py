"""Messages that are lost on their way, for good: each with the same probability, or by link, drawn from a seed.

The next message of the same channel shows its receiver that some are missing, as numbers on messages would. Where none
follows, robots notice when nothing arrives any more.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Mapping

from robochoc.communication.simulator.channel import ChannelModel
from robochoc.communication.simulator.link_loss import Point, distance, either, place_of
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


class LinkLosses(Losses):
    """Draws which messages are lost by what `channel` says of each link."""

    def __init__(self, channel: ChannelModel, seed: int) -> None:
        super().__init__(channel.message_loss, seed)
        self._channel = channel
        self._seed = seed
        self._named = {link: named.loss for named in channel.links for link in named.directions}
        self._bursts: dict[Link, _Burst] = {}
        self._team: Team | None = None
        self._values_of: Callable[[str], Mapping[str, int]] = lambda _: {}
        self._places: dict[tuple[object, ...], Point | None] = {}

    def follow(self, team: Team, values_of: Callable[[str], Mapping[str, int]]) -> None:
        """See `Losses.follow`."""
        self._team, self._values_of = team, values_of
        self._places.clear()

    def _loss_of(self, link: Link) -> float:
        """Return what `Losses._loss_of` returns: all causes of a loss are independent of each other."""
        if link in self._named:
            return self._named[link]
        usual = either(self._probability, self._loss_by_distance(link))
        return usual if self._channel.bursts is None else either(usual, self._burst_of(link).next())

    def _loss_by_distance(self, link: Link) -> float:
        """Return what is lost by distance. If a robot is nowhere, as its values lead to no place, that is nothing."""
        if not self._channel.by_distance:
            return 0.0
        sender, receiver = map(self._place_of, link)
        return 0.0 if sender is None or receiver is None else self._channel.loss_at(distance(sender, receiver))

    def _place_of(self, name: str) -> Point | None:
        """Return where a robot is: where it stands, or where the values that it has now lead to."""
        place = self._channel.positions.get(name)
        if place is not None or self._team is None or name not in self._team:
            return place
        values = self._values_of(name)
        key = (name, *values.values())
        if key not in self._places:
            self._places[key] = place_of(self._team[name], values)
        return self._places[key]

    def _burst_of(self, link: Link) -> _Burst:
        if link not in self._bursts:
            self._bursts[link] = _Burst(self._channel, f"bursts {self._seed} {link[0]} {link[1]}")
        return self._bursts[link]


class _Burst:
    """The state of one link: in a burst, or not."""

    def __init__(self, channel: ChannelModel, seed: str) -> None:
        self._bursts = channel.bursts
        self._chance = random.Random(seed)  # noqa: S311 - a radio is no secret
        self._is_on = False

    def next(self) -> float:
        """Go on to the next message; return with which probability a burst takes it."""
        if self._bursts is None:
            return 0.0
        drawn = self._chance.random()
        self._is_on = drawn >= self._bursts.end if self._is_on else drawn < self._bursts.begin
        return self._bursts.loss if self._is_on else 0.0
