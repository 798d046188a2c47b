"""A robot's knowledge about the search, apart from its own value. It is used in the result, and not sent to robots.

A protocol that minimises costs may be queried before it ends. Each protocol reports the knowledge that it has: the
cheapest assignment so far, a lower bound, the robot's position in the pseudo-tree that the robots have built, or its
values in each cycle.
"""

from __future__ import annotations

import msgspec

from robochoc.model.outcome import PseudoTreeNode
from robochoc.model.problem import Value


class Incumbent(msgspec.Struct, frozen=True):
    """The cheapest assignment of all robots that is known to one robot, and its `cost`."""

    cost: float
    values: dict[str, Value]


class Trail(msgspec.Struct, frozen=True):
    """The values of a robot in each cycle of a synchronous protocol, as pairs (cycle, index of the value).

    There is a pair for each change of the value. The values up to `cycle` are final.
    """

    entries: list[tuple[int, int]]
    cycle: int


class Listing(msgspec.Struct, frozen=True):
    """The indices of a robot's values in the optima that its tree lists (at most `limit` optima)."""

    places: list[int]
    limit: int


class ListedPoints(msgspec.Struct, frozen=True):
    """The indices of a robot's values in the points of its tree's Pareto front, and for a root also the packed costs.

    See `model/objectives.py` on packed costs.
    """

    places: list[int]
    packed: list[int]


class Findings(msgspec.Struct, frozen=True):
    """A robot's knowledge about the whole search; None for information that the robot or its protocol does not have.

    `bound` is a lower bound on the cost of every assignment of the robots that it covers (for a root: the robots of its
    tree; for the first robot: all). `share` is a part of such a bound: the bound is the sum of all robots' shares.
    `count` is the number of optima of a root's tree, in hexadecimal digits, because it may need more than 64 bits;
    `listing` contains the robot's values in some of these optima; `points` contains its values in the points of a
    Pareto front. `left` contains the indices of the values that remain after preprocessing.
    """

    best: Incumbent | None = None
    bound: float | None = None
    place: PseudoTreeNode | None = None
    trail: Trail | None = None
    left: tuple[int, ...] | None = None
    count: str | None = None
    listing: Listing | None = None
    points: ListedPoints | None = None
    share: float | None = None


NO_FINDINGS = Findings()
