"""What a robot can say of the search besides its own value: for who collects the result, and for nobody else's moves.

A protocol that minimises may be asked before it is done. What it knows by then is of different kinds, and each
protocol tells what it has: the cheapest assignment so far, a lower bound, its place in the pseudo-tree that the
robots have built, or the values that it has had, cycle by cycle.
"""

from __future__ import annotations

import msgspec

from robochoc.model.message import Value
from robochoc.model.outcome import PseudoTreeNode


class Incumbent(msgspec.Struct, frozen=True):
    """The cheapest assignment of all robots that this one has heard of, and its `cost`."""

    cost: float
    values: dict[str, Value]


class Trail(msgspec.Struct, frozen=True):
    """The values that a robot has had in each cycle of a synchronous protocol: entries (cycle, place of the value).

    There is an entry where the value changes; between two it stays. All of it up to `cycle` is final.
    """

    entries: list[tuple[int, int]]
    cycle: int


class Findings(msgspec.Struct, frozen=True):
    """What one robot knows of the whole; None where it, or its protocol, knows nothing of the kind.

    `bound`: no assignment of the robots that it speaks for (a root: of its tree; the first robot: of all) costs less.
    """

    best: Incumbent | None = None
    bound: float | None = None
    place: PseudoTreeNode | None = None
    trail: Trail | None = None


NOTHING = Findings()
