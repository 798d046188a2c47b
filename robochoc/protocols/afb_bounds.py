"""Lower bounds of AFB: the own estimates for each beginning of a CPA, and those that robots below have told."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from robochoc.model.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.compiled import LocalProblem

Cost = int | float
"""Costs are integers, and `inf` where a hard constraint is broken."""

Assignment = tuple[Value, int]
"""A robot's value, and the counter that says how many it has taken so far."""

Stamp = Sequence[int]
"""The time-stamp of a CPA: its robots' counters. Nobody counts twice the same, so it tells the assignments, too."""


class Prices:
    """What the own values cost with each beginning of a CPA: every constraint is looked up once for it.

    What a CPA has in common with the last one is not looked up again. `estimates` says for each beginning, the empty
    one first, what the cheapest own value costs with it, and with lower robots only.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        self._problem = problem
        self._names = order.names
        self._below = frozenset(order.names[order.rank[problem.agent] + 1 :])
        self._stamp: Stamp = ()
        self._view: dict[str, Value] = {}
        self._rows: list[list[Cost]] = []
        self._depths = [0]
        self.estimates: list[Cost] = []

    def look_ahead(self) -> None:
        """Look up what does not depend on any CPA."""
        self._rows = [self._problem.costs({})]
        self.estimates = [self._estimate(self._rows[0])]

    def price(self, assignments: Sequence[Assignment]) -> None:
        """Look at all values with `assignments` of the first robots, and with each of their beginnings."""
        stamp = stamp_of(assignments)
        common = agreement(self._stamp, stamp)
        if common == len(assignments):
            return
        for known in (self._rows, self._depths, self.estimates):
            del known[common + 1 :]
        self._view = dict(zip(self._names, (value for value, _ in assignments[:common]), strict=False))
        self._stamp = stamp
        for length in range(common, len(assignments)):
            self._add(self._names[length], assignments[length][0], length + 1)

    def told(self, length: int) -> list[Cost]:
        """The estimates for beginnings up to `length`, without those at the end that depend on nothing more."""
        return self.estimates[: self._depths[length] + 1]

    @property
    def last(self) -> list[Cost]:
        """What each own value costs with the assignments that came last."""
        return self._rows[-1]

    def at_least(self, index: int) -> Cost:
        """What the value at `index` costs with the assignments that came last, and with lower robots only."""
        return self._rows[-1][index] + self._ahead[index]

    def dearest_first(self) -> list[int]:
        """All own values, those at the end first that cost `at_least` the least; of equals, the first is last."""
        return sorted(range(len(self._problem.values) - 1, -1, -1), key=self.at_least, reverse=True)

    def _add(self, robot: str, value: Value, length: int) -> None:
        self._view[robot] = value
        more = self._problem.added(robot, self._view)
        if more is None:
            self._rows.append(self._rows[-1])
            self._depths.append(self._depths[-1])
            self.estimates.append(self.estimates[-1])
            return
        self._rows.append([cost + added for cost, added in zip(self._rows[-1], more, strict=True)])
        self._depths.append(length)
        self.estimates.append(self._estimate(self._rows[-1]))

    def _estimate(self, row: Sequence[Cost]) -> Cost:
        return min(cost + ahead for cost, ahead in zip(row, self._ahead, strict=True))

    @cached_property
    def _ahead(self) -> list[Cost]:
        """What each own value costs at least with lower robots only (h)."""
        return self._problem.lower_bounds(self._below)


class Told(NamedTuple):
    """Estimates for a CPA of that time-stamp and all its beginnings, the empty one first.

    The last one holds for all longer beginnings.
    """

    stamp: Stamp
    estimates: Sequence[Cost]

    def along(self, stamp: Stamp) -> list[Cost]:
        """What stands of it for each beginning of a CPA: nothing is said of what goes beyond what they have in common.

        An estimate for a beginning is one for all that begin like it, if not the best one.
        """
        known = self.estimates[: agreement(self.stamp, stamp) + 1]
        return [*known, *[known[-1]] * (len(stamp) + 1 - len(known))]

    def follows(self, before: Told) -> bool:
        """Whether it says no more than what follows from what was told `before`."""
        return self.along(self.stamp) == before.along(self.stamp)


class Estimates:
    """What the robots below have told, each for the CPA that it was asked for.

    An estimate for a beginning stands as long as that is the beginning of the CPA. Robots are silent when they have
    nothing to say that does not follow from what they have told before.
    """

    def __init__(self) -> None:
        self._asked: dict[str, Stamp] = {}
        self._told: dict[str, Told] = {}

    def outdated(self, robot: str, stamp: Stamp) -> bool:
        """Whether `robot` may have another estimate than for the last CPA that it was asked for.

        On how many robots' values its estimates depend, the first one that it tells says for all CPAs.
        """
        if robot not in self._told:
            return True
        return agreement(self._asked[robot], stamp) < len(self._told[robot].estimates) - 1

    def ask(self, robot: str, stamp: Stamp) -> None:
        """`robot` is asked for its estimates for the CPA of this time-stamp."""
        self._asked[robot] = stamp

    def save(self, robot: str, told: Told) -> None:
        """Keep what `robot` tells."""
        self._told[robot] = told

    def totals(self, stamp: Stamp) -> list[Cost]:
        """What the robots below add at least to each beginning of a CPA, the empty one first."""
        if not self._told:
            return [0] * (len(stamp) + 1)
        return [sum(estimates) for estimates in zip(*[told.along(stamp) for told in self._told.values()], strict=True)]


def stamp_of(assignments: Sequence[Assignment]) -> list[int]:
    """The time-stamp of a CPA: the counters in it, the highest robot's first."""
    return [counter for _, counter in assignments]


def agreement(left: Stamp, right: Stamp) -> int:
    """For how many robots, from the first one on, two CPAs have the same assignments: the same counters."""
    for place, (one, other) in enumerate(zip(left, right, strict=False)):
        if one != other:
            return place
    return min(len(left), len(right))
