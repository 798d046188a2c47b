"""Partial assignments as rows of an array, and the costs that one robot adds to them, for `sfb`.

A row is a partial assignment: its lower bound, the cost of its robots, the index of each robot's value, and then, for
each robot below in priority order, a vector with the cost of each of that robot's values, given the values above. The
bound is the cost plus the minimum of each vector.

All costs are whole numbers. The `ceiling`, one more than the maximum sum of all constraints and charges, represents
infinity, and larger numbers are reduced to it. So the numbers are as small as the problem allows, usually one byte
each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.local_problem import LocalProblem

Rows = NDArray[np.integer[Any]]

BOUND, COST, VALUES = 0, 1, 2
"""The columns of a row: its bound, its cost, and the first value's index."""

_SIZES = ("<u1", "<u2", "<u4", "<i8")


class _NAry(NamedTuple):
    """The costs that an n-ary constraint adds to `columns`, the vector of its lowest robot.

    `table` has an axis for the value of each robot in `ranks` (all above), then this robot's axis and the vector's
    axis.
    """

    ranks: tuple[int, ...]
    columns: slice
    table: NDArray[Any]


class ForwardBounds:
    """The costs that the robot of `problem` adds to partial assignments; `domains` are the values of all robots.

    This robot evaluates the constraints in which it is the second-last robot, and adds the costs to the vector of the
    last one. So each constraint is evaluated once, as soon as only one of its robots has no value. `most` is an upper
    bound on the sum of their costs.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder, domains: Sequence[Sequence[Value]]) -> None:
        self.rank = order.rank[problem.agent]
        self.most = 0
        self.ceiling = 0
        self._own = len(domains[self.rank])
        self._above = [len(domain) for domain in domains[: self.rank]]
        self._largest = max(map(len, domains))
        self._sizes = [len(domain) for domain in domains[self.rank + 1 :]]
        self._starts = np.cumsum([0, *self._sizes])
        self._prices: NDArray[Any] = np.zeros((self._own, self._starts[-1]))
        self._n_ary: list[_NAry] = []
        above = dict(zip(order.names[: self.rank], domains, strict=False))
        for place, name in enumerate(order.names[self.rank + 1 :]):
            columns = slice(int(self._starts[place]), int(self._starts[place + 1]))
            for _, agents, charges in problem.tables({**above, name: domains[self.rank + 1 + place]}, lowest=name):
                self.most += int(charges[np.isfinite(charges)].max(initial=0))
                table = np.moveaxis(charges, -1, -2)
                if len(agents) == 1:
                    self._prices[:, columns] += table
                else:
                    self._n_ary.append(_NAry(tuple(order.rank[one] for one in agents[:-1]), columns, table))

    def count_up_to(self, ceiling: int) -> None:
        """Set the `ceiling`, to which all larger costs are reduced from now on."""
        self.ceiling = ceiling
        largest = max(2 * ceiling, self._largest)
        self._type = np.dtype(next(size for size in _SIZES if largest <= np.iinfo(size).max))
        self._prices = self._cut(self._prices)
        self._n_ary = [one._replace(table=self._cut(one.table)) for one in self._n_ary]

    def nothing(self, charges: Sequence[Sequence[float]]) -> Rows:
        """Return the empty partial assignment, with `charges` of all robots' values."""
        bound = sum(min(charged) for charged in charges)
        row = [bound, 0, *(charge for charged in charges for charge in charged)]
        return self._cut(np.array([row], np.float64))

    def read(self, content: bytes, count: int) -> Rows:
        """Return the `count` partial assignments in `content`, which the robot above made with `tobytes`.

        Raises:
            ValueError: if `content` has another form.
        """
        columns = self._first + self._own + int(self._starts[-1])
        if count < 1 or len(content) != count * columns * self._type.itemsize:
            raise ValueError(f"{len(content)} bytes cannot contain {count} partial assignments")
        rows: Rows = np.frombuffer(content, self._type).reshape(count, columns)
        if (rows[:, VALUES : self._first] >= self._above).any() or (rows < 0).any():
            raise ValueError("a partial assignment contains values that do not exist")
        return rows

    @property
    def width(self) -> int:
        """The number of bytes of an extended partial assignment."""
        return (self._first + 1 + int(self._starts[-1])) * self._type.itemsize

    def below(self, rows: Rows, upper_bound: int) -> Rows:
        """Return the `rows` with a lower bound below `upper_bound`."""
        return rows[rows[:, BOUND] < upper_bound]

    def least(self, rows: Rows) -> int:
        """Return the minimum lower bound of `rows`."""
        return int(rows[:, BOUND].min())

    def packed(self, rows: Rows) -> bytes:
        """Return `rows` as the bytes of a message."""
        return rows.tobytes()

    def extended(self, rows: Rows, upper_bound: int) -> Rows:
        """Return all extensions of `rows` by a value of this robot with a lower bound below `upper_bound`.

        The extensions are sorted by lower bound, then by decreasing number of values left to the other robots.
        """
        own = rows[:, self._first : self._first + self._own]
        before = rows[:, BOUND].astype(np.int64) - own.min(axis=1)  # the bound, without this robot's part
        row, value = np.nonzero(before[:, None] + own < upper_bound)
        vectors = self._vectors(rows, row, value)
        costs = rows[row, COST].astype(np.int64) + own[row, value]
        bounds = costs + self._cheapest(vectors).sum(axis=1, dtype=np.int64)
        (kept,) = np.nonzero(bounds < upper_bound)
        kept = kept[np.lexsort((vectors[kept].sum(axis=1, dtype=np.int64), bounds[kept]))]
        extended = np.empty((len(kept), self._first + 1 + vectors.shape[1]), self._type)
        extended[:, BOUND] = bounds[kept]
        extended[:, COST] = costs[kept]
        extended[:, VALUES : self._first] = rows[row[kept], VALUES : self._first]
        extended[:, self._first] = value[kept]
        extended[:, self._first + 1 :] = vectors[kept]
        return extended

    def completed(self, rows: Rows) -> tuple[int, list[int]]:
        """Return the cost and the values of the cheapest extension of `rows`, for all robots but this one."""
        costs = rows[:, COST, None].astype(np.int64) + rows[:, self._first :]
        row, value = divmod(int(costs.argmin()), self._own)
        return int(costs[row, value]), [*rows[row, VALUES : self._first].tolist(), value]

    def _vectors(self, rows: Rows, row: NDArray[np.intp], value: NDArray[np.intp]) -> Rows:
        """Return the vectors of the robots below, after each of the rows at `row` is extended by `value`."""
        vectors = rows[row, self._first + self._own :]
        vectors += self._prices[value]
        np.minimum(vectors, self.ceiling, out=vectors)
        for ranks, columns, table in self._n_ary:
            chosen = tuple(rows[row, VALUES + rank] for rank in ranks)
            priced = vectors[:, columns] + table[(*chosen, value)]
            vectors[:, columns] = np.minimum(priced, self.ceiling)
        return vectors

    def _cheapest(self, vectors: Rows) -> Rows:
        """Return the minimum of each robot's vector."""
        if len(set(self._sizes)) > 1:
            return np.minimum.reduceat(vectors, self._starts[:-1], axis=1)
        blocks = vectors.reshape(len(vectors), len(self._sizes), self._sizes[0])
        least = blocks[:, :, 0].copy()
        for place in range(1, self._sizes[0]):  # many short rows: column by column is four times as fast
            np.minimum(least, blocks[:, :, place], out=least)
        return least

    def _cut(self, costs: NDArray[Any]) -> Rows:
        return np.asarray(np.minimum(costs, self.ceiling), self._type)

    @property
    def _first(self) -> int:
        """The column after the values of the robots above: that of this robot's value, or the first in its vector."""
        return VALUES + self.rank
