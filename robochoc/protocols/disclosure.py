"""Statements about robots' problems: messages declare with them what their receivers learn (`Message.proves`).

Each message type declares its own rule. Its proofs are true statements, each by itself, about the problem, which does
not change during a run, and about the value that a robot has chosen. `robochoc/privacy` adds up the consequences. In
all statements, the *own cost* of a robot's value, in a view of other robots' values, is the cost of this value in the
robot's private constraints, plus its cost in every constraint between this robot and robots in the view whose other
robots are all in the view. `INFINITE` means a broken hard constraint, or a value that is not possible for the robot.

The observer is assumed to know, from the start: its own problem; the constraints that it shares, except other robots'
parts of partially known ones; the declared domains of all variables that neighbours see; the order; and which robots
share constraints with each other.
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
"""Values by robot; None if a variable does not matter."""


class HasValue(NamedTuple):
    """`robot` has chosen `value`, and keeps it until the observer receives another value.

    If several such statements concern the same robot, the one with the largest `stamp` is valid; among equal stamps,
    the last one.
    """

    robot: str
    value: Value
    stamp: tuple[int, ...] = ()


class HasCompatibleValue(NamedTuple):
    """`robot` has chosen a value that is compatible with exactly the values of `other` whose bits are set in `allowed`.

    The bits are in the order of `other`'s declared values. Only constraints between these two robots that `robot` knows
    count; if `parts_only` is true, only the parts of partially known constraints that `robot` knows. The statement is
    valid until the observer receives another one, as in `HasValue`.
    """

    robot: str
    other: str
    allowed: bytes
    parts_only: bool


class HasOnly(NamedTuple):
    """These values, and no others, are possible for `robot`; the observer then knows them by their indices."""

    robot: str
    values: tuple[Value, ...]


class Pays(NamedTuple):
    """The own cost of `value` of `robot` in `view` is between `least` and `most`."""

    robot: str
    value: Value
    view: View
    least: float
    most: float


class PartPays(NamedTuple):
    """The parts of `robot` in partially known constraints with `other` charge `cost` for this pair of values."""

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
    """At least one value of `robot` has an own cost of at most `most` in `view`."""

    robot: str
    view: View
    most: float


class Total(NamedTuple):
    """The total cost of the values of all robots in `view`, in all constraints among these robots, is `cost`."""

    view: View
    cost: float


class Clash(NamedTuple):
    """A hard constraint among the robots in `view`, whose values are all known, is broken."""

    view: View


Proof = HasValue | HasCompatibleValue | HasOnly | Pays | PartPays | EveryValuePays | SomeValuePays | Total | Clash
NOTHING: tuple[Proof, ...] = ()
"""The proofs of a message that proves nothing. Such a message has a rule, unlike one whose `proves` returns None."""
AT_THE_END = (2**62,)
"""The stamp of a final value."""
FINITE = float(2**53)
"""The upper bound on a cost that is only known to be finite. It exceeds all costs in a problem."""


class Reception(ABC):
    """A received message in its context: its sender, and the knowledge of the observer that receives it.

    Attributes:
        sender: The sender of the message.
        receiver: The observer.
        order: All robots, the highest priority first.
        branch: The robots whose values appear in a partial assignment from the sender, the highest first.
        fixed_holders: Each constraint is checked by the lowest robot in its scope, and the order does not change.
        minimises: The run minimises costs, or the number of robots that withdraw.
        max_cost: The highest finite cost of a secret.
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
        """Return the possible values of `robot`, in its declared order, if the observer already knows them."""

    @abstractmethod
    def width(self, robot: str) -> int:
        """Return the number of variables that `robot` shows its neighbours."""

    @abstractmethod
    def last(self, kind: type[M], sender: str, receiver: str) -> M | None:
        """Return the last message of type `kind` between `sender` and `receiver`, one of which is the observer."""

    def is_lowest(self, robot: str) -> bool:
        """Return whether no robot has lower priority than `robot`."""
        return bool(self.order) and self.order[-1] == robot

    def is_only_neighbour(self) -> bool:
        """Return whether the receiver is the only neighbour of the sender."""
        return {*self.neighbours(self.sender)} == {self.receiver}


def can_take(robot: str, value: Value) -> Proof:
    """Return the proof that `value` is possible for `robot`."""
    return Pays(robot, value, {}, 0, FINITE)


def partial_assignment(robots: Sequence[str], values: Sequence[Value]) -> list[Proof]:
    """Return the proofs in a consistent partial assignment: each value is compatible with the values before it.

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
    axes: Sequence[str], cells: Iterable[tuple[Sequence[int], float]], reception: Reception
) -> Sequence[Proof]:
    """Return the proofs in `cells` of the sender's table: indices on its axes, and the least cost with these values.

    Robots whose values the receiver does not know are left out of the views: if some value of the sender has a bounded
    cost together with one of their values, the same bound holds without them.
    """
    sender = reception.sender
    near = [(robot, reception.values(robot)) for robot in reception.neighbours(sender) if robot not in axes]
    single = {robot: values[0] for robot, values in near if values is not None and len(values) == 1}
    none_below = {*axes, *single} >= set(reception.neighbours(sender))
    least: dict[tuple[tuple[str, Value], ...], float] = {}
    all_known = all(reception.values(robot) is not None for robot in axes)
    for places, cost in cells:
        known = zip(axes, places, strict=True)
        view = tuple([(robot, values[at]) for robot, at in known if (values := reception.values(robot)) is not None])
        least[view] = min(cost, least.get(view, INFINITE))
    found: list[Proof] = []
    for view, cost in least.items():
        found.append(SomeValuePays(sender, {**single, **dict(view)}, cost))
        if none_below and all_known:
            found.append(EveryValuePays(sender, {**single, **dict(view)}, cost))
    return found
