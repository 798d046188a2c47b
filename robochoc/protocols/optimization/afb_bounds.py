"""Lower bounds in AFB: a robot's estimates for each prefix of a CPA, and the estimates received from robots below."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.local_problem import LocalProblem

Cost = int | float
"""Costs are integers, or `inf` if a hard constraint is broken."""

Assignment = tuple[Value, int]
"""A robot's value, and the number of values that it has taken so far."""

Stamp = Sequence[int]
"""The time-stamp of a CPA: the counters of its robots. Counters are never reused, so it identifies the assignments."""


class CostLookup:
    """The costs of this robot's values for each prefix of a CPA. Each constraint is evaluated once per prefix.

    The prefix that a CPA shares with the previous one is not evaluated again. `estimates` contains, for each prefix,
    the empty one first, the minimum cost over this robot's values, including h.
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
        """Compute the lower bounds that do not depend on a CPA (h)."""
        self._rows = [self._problem.costs({})]
        self.estimates = [self._estimate(self._rows[0])]

    def look_up(self, assignments: Sequence[Assignment]) -> None:
        """Compute the costs of all values for `assignments` of the first robots and for each prefix."""
        stamp = stamp_of(assignments)
        common = common_length(self._stamp, stamp)
        if common == len(assignments):
            return
        for known in (self._rows, self._depths, self.estimates):
            del known[common + 1 :]
        self._view = dict(zip(self._names, (value for value, _ in assignments[:common]), strict=False))
        self._stamp = stamp
        for length in range(common, len(assignments)):
            self._add(self._names[length], assignments[length][0], length + 1)

    def shared(self, length: int) -> list[Cost]:
        """Return the estimates for prefixes up to `length`, without repetitions at the end."""
        return self.estimates[: self._depths[length] + 1]

    @property
    def last(self) -> list[Cost]:
        """The cost of each value of this robot with the last assignments."""
        return self._rows[-1]

    def lower_bound(self, index: int) -> Cost:
        """Return a lower bound for the value at `index`: its cost with the last assignments, plus h."""
        return self._rows[-1][index] + self._ahead[index]

    def by_decreasing_cost(self) -> list[int]:
        """Return all values of this robot by decreasing lower bound; among equals, the first value is last."""
        return sorted(range(len(self._problem.values) - 1, -1, -1), key=self.lower_bound, reverse=True)

    def _add(self, robot: str, value: Value, length: int) -> None:
        self._view[robot] = value
        more = self._added(robot)
        if more is None:
            self._rows.append(self._rows[-1])
            self._depths.append(self._depths[-1])
            self.estimates.append(self.estimates[-1])
            return
        self._rows.append([cost + added for cost, added in zip(self._rows[-1], more, strict=True)])
        self._depths.append(length)
        self.estimates.append(self._estimate(self._rows[-1]))

    def _added(self, robot: str) -> Sequence[Cost] | None:
        """Return the additional cost of each value with the value of `robot`, the lowest known robot; None: no cost."""
        return self._problem.added(robot, self._view)

    def _estimate(self, row: Sequence[Cost]) -> Cost:
        return min(cost + ahead for cost, ahead in zip(row, self._ahead, strict=True))

    @cached_property
    def _ahead(self) -> list[Cost]:
        """A lower bound on each value's cost with lower-priority robots only (h)."""
        return self._problem.lower_bounds(self._below)


class CPAEstimates(NamedTuple):
    """The estimates for the CPA with one time-stamp and all its prefixes, the empty one first.

    The last estimate also holds for all longer prefixes.
    """

    stamp: Stamp
    estimates: Sequence[Cost]

    def along(self, stamp: Stamp) -> list[Cost]:
        """Return the estimates that are valid for the prefixes of another CPA, given its time-stamp.

        Estimates hold for the common prefix only. An estimate for a prefix is also a (weaker) estimate for all its
        extensions.
        """
        known = self.estimates[: common_length(self.stamp, stamp) + 1]
        return [*known, *[known[-1]] * (len(stamp) + 1 - len(known))]

    def follows(self, before: CPAEstimates) -> bool:
        """Return whether these estimates add nothing to `before`, which were sent earlier."""
        return self.along(self.stamp) == before.along(self.stamp)


class Estimates:
    """The estimates received from lower-priority robots, each with the CPA that it was requested for.

    An estimate for a prefix is valid while the CPA has that prefix. A robot sends nothing if its new estimates follow
    from those that it sent before.
    """

    def __init__(self) -> None:
        self._asked: dict[str, Stamp] = {}
        self._received: dict[str, CPAEstimates] = {}

    def outdated(self, robot: str, stamp: Stamp) -> bool:
        """Return whether the estimate of `robot` may differ from its estimate for the last CPA sent to it.

        The first estimates that a robot sends show the number of robots on whose values they depend.
        """
        if robot not in self._received:
            return self._asked.get(robot) != stamp
        return common_length(self._asked[robot], stamp) < len(self._received[robot].estimates) - 1

    def ask(self, robot: str, stamp: Stamp) -> None:
        """Record that `robot` was asked for its estimates for the CPA with this time-stamp."""
        self._asked[robot] = stamp

    def save(self, robot: str, estimates: CPAEstimates) -> None:
        """Store the `estimates` that `robot` sent."""
        self._received[robot] = estimates

    def totals(self, stamp: Stamp) -> list[Cost]:
        """Return the sum of the lower robots' estimates for each prefix of a CPA, the empty one first."""
        if not self._received:
            return [0] * (len(stamp) + 1)
        return [
            sum(estimates) for estimates in zip(*[one.along(stamp) for one in self._received.values()], strict=True)
        ]


def stamp_of(assignments: Sequence[Assignment]) -> list[int]:
    """Return the time-stamp of a CPA: its counters, the highest-priority robot's first."""
    return [counter for _, counter in assignments]


def common_length(left: Stamp, right: Stamp) -> int:
    """Return the length of the common prefix of two CPAs, by their time-stamps."""
    for place, (one, other) in enumerate(zip(left, right, strict=False)):
        if one != other:
            return place
    return min(len(left), len(right))
