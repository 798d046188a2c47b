"""Loss models for links: by the distance between two robots, in bursts, and on named links.

They are the fields in a channel model's file (docs/guides/channels.md). `channel_losses.py` uses them to draw losses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import msgspec

from robochoc.formats.diagnostics import shortened
from robochoc.model.expression import Expression, UndefinedValueError, evaluate
from robochoc.model.problem import Robot

Point = tuple[float, ...]
SPEED_OF_LIGHT = 299_792_458.0
"""The speed of light in vacuum, in metres a second."""
FARTHEST = 10**9
"""The largest accepted coordinate or distance. Larger values are certainly mistakes."""

_PATH_LOSS = {
    "power_dbm": (-100, 100),
    "sensitivity_dbm": (-200, 100),
    "frequency_hz": (1000, 10**12),
    "exponent": (1, 10),
    "shadowing_db": (0, 40),
    "reference_m": (0.001, 10**6),
}
_MOST_PAIRS = 1000


class PathLoss(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Log-distance path loss with log-normal shadowing, and a receiver threshold (Rappaport 2002, section 4.9).

    The sender radiates `power_dbm` towards the receiver, including the gains of both antennas. Up to `reference_m` the
    loss is the free-space loss at `frequency_hz` (Friis); beyond `reference_m` it grows by 10 `exponent` dB for each
    factor of 10. In free space the `exponent` is 2. Obstacles add a normally distributed number of dB with the standard
    deviation `shadowing_db`, drawn for each message. A message that arrives with less than `sensitivity_dbm` is lost.
    Raises `ValueError` for invalid values.
    """

    power_dbm: float
    sensitivity_dbm: float
    frequency_hz: float = 2.4e9
    exponent: float = 2.0
    shadowing_db: float = 0.0
    reference_m: float = 1.0

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for field, (least, most) in _PATH_LOSS.items():
            refuse_beyond(field, getattr(self, field), least, most)

    def margin_db(self, distance_m: float) -> float:
        """Return the mean margin of a signal above the receiver's threshold at this distance."""
        near = 20 * math.log10(4 * math.pi * self.reference_m * self.frequency_hz / SPEED_OF_LIGHT)
        beyond = 10 * self.exponent * math.log10(max(distance_m / self.reference_m, 1))
        return self.power_dbm - near - beyond - self.sensitivity_dbm

    def loss_at(self, distance_m: float) -> float:
        """Return the probability that a message is lost at this distance: Q(margin / shadowing)."""
        margin = self.margin_db(distance_m)
        if not self.shadowing_db:
            return float(margin < 0)
        return 0.5 * math.erfc(margin / self.shadowing_db / math.sqrt(2))


class Bursts(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Losses in bursts: a channel with two states (Gilbert 1960; Elliott 1963). Each link has its own state.

    Before each message on a link, a burst begins with the probability `begin`, or ends with the probability `end`. In a
    burst a message is lost with the probability `loss`, in addition to other losses. Initially no link is in a burst.
    Raises `ValueError` for invalid values.
    """

    begin: float
    end: float
    loss: float

    def __post_init__(self) -> None:
        """Refuse values out of range. Every burst must be able to end."""
        refuse_beyond("begin", self.begin, 0, 1)
        refuse_beyond("end", self.end, 0.001, 1)
        refuse_beyond("loss", self.loss, 0, 1)

    @property
    def mean(self) -> float:
        """The long-run share of messages lost in bursts."""
        return self.loss * self.begin / (self.begin + self.end)


class NamedLink(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A link with its own loss, which replaces all other losses: `between` two robots, in both directions.

    `one_way`: only from the first robot to the second. Raises `ValueError` for invalid values.
    """

    between: tuple[str, str]
    loss: float
    one_way: bool = False

    def __post_init__(self) -> None:
        """Refuse a link from a robot to itself, and an invalid probability."""
        if self.between[0] == self.between[1]:
            raise ValueError(f"between: expected two robots, got {shortened(self.between[0])} twice")
        refuse_beyond("loss", self.loss, 0, 1)

    @property
    def directions(self) -> tuple[tuple[str, str], ...]:
        """The pairs of sender and receiver on this link."""
        return (self.between,) if self.one_way else (self.between, self.between[::-1])


def either(one: float, other: float) -> float:
    """Return the probability that at least one of two independent events occurs."""
    return one + other - one * other


def refuse_beyond(field: str, value: float, least: float, most: float) -> None:
    """Raise `ValueError` for a number outside the range from `least` to `most`."""
    if not least <= value <= most:
        raise ValueError(f"{field}: expected a number from {least:,} to {most:,}, got {value:g}")


def refuse_table(pairs: Sequence[tuple[float, float]]) -> None:
    """Raise `ValueError` for an invalid table of distances and losses."""
    if len(pairs) > _MOST_PAIRS:
        raise ValueError(f"distance_loss: expected up to {_MOST_PAIRS:,} pairs, got {len(pairs):,}")
    for distance, loss in pairs:
        refuse_beyond("distance_loss", distance, 0, FARTHEST)
        refuse_beyond("distance_loss", loss, 0, 1)
    for (before, _), (after, _) in pairwise(pairs):
        if before >= after:
            raise ValueError(f"distance_loss: expected growing distances, got {after:g} after {before:g}")


def refuse_positions(positions: Mapping[str, Point]) -> None:
    """Raise `ValueError` for invalid positions."""
    for robot, point in positions.items():
        if len(point) not in {2, 3} or not all(abs(one) <= FARTHEST for one in point):
            raise ValueError(f"positions: {shortened(robot)}: expected [x, y] or [x, y, z], up to {FARTHEST:,} each")


def loss_by_table(pairs: Sequence[tuple[float, float]], distance: float) -> float:
    """Return the loss at a distance. It is interpolated linearly between the `pairs`, and constant outside them."""
    before, loss_before = pairs[0]
    for after, loss in pairs[1:]:
        if distance <= after:
            share = max(distance - before, 0) / (after - before)
            return loss_before + share * (loss - loss_before)
        before, loss_before = after, loss
    return loss_before


def place_of(robot: Robot, values: Mapping[str, int]) -> Point | None:
    """Return the position of `robot` under `values`, from its first topic with x and y, or None if it has no position.

    A variable without a value is treated as if it had the first value in its domain.
    """
    first = {variable.name: next(iter(variable.domain), 0) for variable in robot.variables}
    values = {**first, **values}
    for topic in robot.topics:
        if topic.x is not None and topic.y is not None:
            axes = [topic.x, topic.y, *([] if topic.z is None else [topic.z])]
            return _evaluated(axes, values)
    return None


def has_place(robot: Robot) -> bool:
    """Return whether a topic of `robot` has x and y coordinates."""
    return any(topic.x is not None and topic.y is not None for topic in robot.topics)


def _evaluated(axes: Sequence[Expression], values: Mapping[str, int]) -> Point | None:
    try:
        return tuple([float(evaluate(axis, values)) for axis in axes])
    except UndefinedValueError:  # for example a division by zero
        return None


def distance(one: Point, other: Point) -> float:
    """Return the distance between two points. A missing third coordinate counts as 0."""
    return math.dist((*one, 0.0)[:3], (*other, 0.0)[:3])
