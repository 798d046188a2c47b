"""Draws the messages that are permanently lost under a channel model: by distance, in bursts, and on named links."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping

from robochoc.communication.simulator.channel import ChannelModel
from robochoc.communication.simulator.loss_models import Point, distance, either, place_of
from robochoc.communication.simulator.losses import Link, Losses
from robochoc.model.problem import Team


class ChannelLosses(Losses):
    """Draws lost messages by the loss models in `channel`."""

    def __init__(self, channel: ChannelModel, seed: int) -> None:
        super().__init__(channel.message_loss, seed)
        self._channel = channel
        self._seed = seed
        self._named = {link: named.loss for named in channel.links for link in named.directions}
        self._bursts: dict[Link, _Burst] = {}
        self._team: Team | None = None
        self._values_of: Callable[[str], Mapping[str, int]] = lambda _: {}
        self._places: dict[str, tuple[Mapping[str, int], Point | None]] = {}
        """The latest known values of each robot, and the resulting position."""

    def follow(self, team: Team, values_of: Callable[[str], Mapping[str, int]]) -> None:
        """See `Losses.follow`."""
        self._team, self._values_of = team, values_of
        self._places.clear()

    def _loss_of(self, link: Link) -> float:
        """See `Losses._loss_of`. All causes of loss are independent."""
        if link in self._named:
            return self._named[link]
        usual = either(self._probability, self._loss_by_distance(link))
        return usual if self._channel.bursts is None else either(usual, self._burst_of(link).next())

    def _loss_by_distance(self, link: Link) -> float:
        """Return the probability of a loss by distance; 0 if a robot has no position."""
        if not self._channel.by_distance:
            return 0.0
        sender, receiver = map(self._place_of, link)
        return 0.0 if sender is None or receiver is None else self._channel.loss_at(distance(sender, receiver))

    def _place_of(self, name: str) -> Point | None:
        """Return the position of a robot: from the channel model, or else from the robot's current values."""
        place = self._channel.positions.get(name)
        if place is not None or self._team is None or name not in self._team:
            return place
        values = self._values_of(name)
        known = self._places.get(name)
        if known is None or known[0] != values:
            known = self._places[name] = {**values}, place_of(self._team[name], values)
        return known[1]

    def _burst_of(self, link: Link) -> _Burst:
        if link not in self._bursts:
            self._bursts[link] = _Burst(self._channel, f"bursts {self._seed} {link[0]} {link[1]}")
        return self._bursts[link]


class _Burst:
    """The burst state of one link."""

    def __init__(self, channel: ChannelModel, seed: str) -> None:
        self._bursts = channel.bursts
        self._chance = random.Random(seed)  # noqa: S311 - a radio is no secret
        self._is_on = False

    def next(self) -> float:
        """Advance to the next message, and return the probability that it is lost in a burst."""
        if self._bursts is None:
            return 0.0
        drawn = self._chance.random()
        self._is_on = drawn >= self._bursts.end if self._is_on else drawn < self._bursts.begin
        return self._bursts.loss if self._is_on else 0.0
