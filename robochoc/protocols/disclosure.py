"""The statements about robots' problems in which a message's rule (`Message.proves`) is written.

A rule stands with its message (`Message.proves`). Its proofs are true statements, each on its own: about the problem,
which does not change during a run, and about the value that a robot has taken. `robochoc/privacy` adds up what follows.
In all of them the *own cost* of a robot's value, in a view of other robots' values, is what the robot's private
constraints charge for the value, and every constraint between this robot and robots of the view whose other robots are
all in the view. `INFINITE` is a hard constraint that is broken, or a value that the robot cannot take.

The observer is taken to know, from the start: its own problem; the constraints that it shares, but for other robots'
parts of partially known ones; the declared domains of all variables that neighbours see; the order; who shares a
constraint with whom.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple, TypeVar

from robochoc.model.problem import Value

M = TypeVar("M")
INFINITE = math.inf
View = Mapping[str, Value]
"""Values by robot; None where a variable does not matter."""


class StandsAt(NamedTuple):
    """`robot` has taken `value`, and keeps it until the observer hears otherwise.

    Of several such statements about a robot the one with the largest `stamp` counts, and the last of these.
    """

    robot: str
    value: Value
    stamp: tuple[int, ...] = ()


class StandsWhere(NamedTuple):
    """`robot` has taken a value that goes with exactly the values of `other` whose bits are set in `allowed`.

    The bits are in the order of `other`'s declared values. Only constraints between these two robots that `robot` knows
    count; with `parts_only` its parts of partially known ones. The statement stands until the observer hears otherwise,
    as in `StandsAt`.
    """

    robot: str
    other: str
    allowed: bytes
    parts_only: bool


class HasOnly(NamedTuple):
    """`robot` can take these values, and no others; the observer then knows them by their places."""

    robot: str
    values: tuple[Value, ...]


class Pays(NamedTuple):
    """The own cost of `value` of `robot` in `view` is from `least` to `most`."""

    robot: str
    value: Value
    view: View
    least: float
    most: float


class PartPays(NamedTuple):
    """The parts of `robot` in partially known constraints with `other` charge `cost` for these values of both."""

    robot: str
    value: Value
    other: str
    theirs: Value
    cost: float


class EveryValuePays(NamedTuple):
    """The own cost of every value of `robot` in `view` is at least `least`."""

    robot: str
    view: View
    least: float


class SomeValuePays(NamedTuple):
    """There is a value of `robot` whose own cost in `view` is at most `most`."""

    robot: str
    view: View
    most: float


class Total(NamedTuple):
    """The values of all robots in `view` charge, and all constraints among them cost, `cost` together."""

    view: View
    cost: float


class Clash(NamedTuple):
    """A hard constraint among the robots of `view`, all of them known values, is broken."""

    view: View


Proof = StandsAt | StandsWhere | HasOnly | Pays | PartPays | EveryValuePays | SomeValuePays | Total | Clash
NOTHING: tuple[Proof, ...] = ()
"""The proofs of a message that gives none here. It has a rule, unlike a message whose `proves` returns None."""
AT_THE_END = (2**62,)
"""The stamp of a value that is not changed any more."""
FINITE = float(2**53)
"""The upper bound of a cost of which no more is known than that it is not infinite: above all costs of a problem."""


class Hearing(ABC):
    """A message as its receiver, the observer, hears it: from whom, and what it knows by then.

    Attributes:
        sender: Who sent the message.
        receiver: The observer.
        order: All robots, the highest priority first.
        branch: The robots whose values a partial assignment of the sender holds, the highest first.
        fixed_holders: Each constraint is checked by the lowest robot of its scope, and the order does not change.
        minimises: Something is minimised, costs or robots that withdraw.
        max_cost: No finite cost of a secret is higher.
    """

    sender: str
    receiver: str
    order: Sequence[str]
    branch: Sequence[str]
    fixed_holders: bool
    minimises: bool
    max_cost: float

    @abstractmethod
    def neighbours(self, robot: str) -> Collection[str]:
        """Return the robots that share a constraint with `robot`."""

    @abstractmethod
    def values(self, robot: str) -> Sequence[Value] | None:
        """Return the values that `robot` can take, in its own order, if the observer knows them by now."""

    @abstractmethod
    def width(self, robot: str) -> int:
        """Return the number of variables that `robot` shows its neighbours."""

    @abstractmethod
    def last(self, kind: type[M], sender: str, receiver: str) -> M | None:
        """Return the last message of this kind on a channel whose one end is the observer."""

    def is_lowest(self, robot: str) -> bool:
        """Return whether no robot has lower priority than `robot`."""
        return bool(self.order) and self.order[-1] == robot

    def is_only_neighbour(self) -> bool:
        """Return whether the sender shares constraints with the receiver alone."""
        return {*self.neighbours(self.sender)} == {self.receiver}


def can_take(robot: str, value: Value) -> Proof:
    """Return that `robot` can take `value`."""
    return Pays(robot, value, {}, 0, FINITE)


def partial_assignment(robots: Sequence[str], values: Sequence[Value]) -> list[Proof]:
    """Return what a consistent partial assignment proves: each value goes with those before it.

    Args:
        robots: The robots, the highest first; there may be more of them than values.
        values: Their values.
    """
    found: list[Proof] = []
    view: dict[str, Value] = {}
    for robot, value in zip(robots, values, strict=False):
        found.append(Pays(robot, value, dict(view), 0, FINITE))
        view[robot] = value
    return found


def table_proves(
    axes: Sequence[str], cells: Iterable[tuple[Sequence[int], float]], hearing: Hearing
) -> Sequence[Proof]:
    """Return what `cells` of the sender's table prove: places on its axes, and the least cost with these values.

    Robots whose values the receiver does not know are left out of the views: what some value of the sender costs at
    most with one of their values, it costs at most without them.
    """
    sender = hearing.sender
    near = [(robot, hearing.values(robot)) for robot in hearing.neighbours(sender) if robot not in axes]
    single = {robot: values[0] for robot, values in near if values is not None and len(values) == 1}
    nobody_below = {*axes, *single} >= set(hearing.neighbours(sender))
    least: dict[tuple[tuple[str, Value], ...], float] = {}
    whole = all(hearing.values(robot) is not None for robot in axes)
    for places, cost in cells:
        known = zip(axes, places, strict=True)
        view = tuple([(robot, values[at]) for robot, at in known if (values := hearing.values(robot)) is not None])
        least[view] = min(cost, least.get(view, INFINITE))
    found: list[Proof] = []
    for view, cost in least.items():
        found.append(SomeValuePays(sender, {**single, **dict(view)}, cost))
        if nobody_below and whole:
            found.append(EveryValuePays(sender, {**single, **dict(view)}, cost))
    return found
