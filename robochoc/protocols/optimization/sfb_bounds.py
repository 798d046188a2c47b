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
from robochoc.protocols.optimization.run_lengths import Columns, RunLengths
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.constraint_arrays import ConstraintRows, RowCosts
from robochoc.solver.cost_table import CostTable
from robochoc.solver.local_problem import LocalProblem

Domain = tuple[Value, ...]
Rows = NDArray[np.integer[Any]]

BOUND, COST, VALUES = 0, 1, 2
"""The columns of a row: its bound, its cost, and the first value's index."""

FEW_COLUMNS = 128
"""The number of columns up to which computations with all columns are faster than with some (measured)."""
MANY_COLUMNS = 3
"""The ratio of all columns to the changed ones up to which computations with all columns are faster (measured)."""
_SIZES = ("<u1", "<u2", "<u4", "<i8")


class _NAry(NamedTuple):
    """The costs that an n-ary constraint adds to `columns`, the vector of its lowest robot among those that change.

    `table` has an axis for each robot in `ranks` (all above), then this robot's axis and the vector's axis. `codes`
    contains, for each axis, the index on it of each of the robot's values; None if the values are the indices.
    """

    ranks: tuple[int, ...]
    columns: slice
    table: NDArray[Any]
    codes: tuple[NDArray[np.intp] | None, ...]

    def costs(self, above: Sequence[NDArray[Any]], own: NDArray[np.intp]) -> NDArray[Any]:
        """Return the costs of all values of the lowest robot, for each row of values `above` and of `own` values."""
        *places, lowest = self.codes
        chosen = [at if codes is None else codes[at] for codes, at in zip(places, (*above, own), strict=True)]
        found: NDArray[Any] = self.table[tuple(chosen)]
        return found if lowest is None else found[:, lowest]


class _Rows(NamedTuple):
    """An n-ary constraint whose table would be too large: its costs are computed for each row (see `_NAry`)."""

    ranks: tuple[int, ...]
    columns: slice
    costs: RowCosts
    problem: LocalProblem


class ForwardBounds:
    """The costs that the robot of `problem` adds to partial assignments; `domains` are the values of all robots.

    This robot evaluates the constraints in which it is the second-last robot, and adds the costs to the vector of the
    last one. So each constraint is evaluated once, as soon as only one of its robots has no value. `most` is an upper
    bound on the sum of their costs.

    In large teams all computations are restricted to the vectors that change, those of the last robots. If these are a
    large part, or if there are few columns, they are done for all vectors: a contiguous part of an array is faster.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder, domains: RunLengths[Domain]) -> None:
        self.rank = order.rank[problem.agent]
        self.most = 0
        self.ceiling = 0
        self._own = len(domains[self.rank])
        self._above = _sizes(domains.counted(0, self.rank))
        self._largest = max(map(len, domains.distinct))
        columns = Columns([(len(domain), count) for domain, count in domains.counted(self.rank + 1, len(domains))])
        self._total = columns.total
        ranks = [(order.rank[name], name) for name in problem.neighbours]
        above = {name: domains[rank] for rank, name in ranks if rank < self.rank}
        found = [
            (rank, table)
            for rank, name in ranks
            if rank > self.rank
            for table in problem.tables_or_rows({**above, name: domains[rank]}, lowest=name)
        ]
        changed = [*dict.fromkeys([rank for rank, _ in found])]
        few = self._total <= FEW_COLUMNS
        if few or MANY_COLUMNS * sum([len(domains[rank]) for rank in changed]) >= self._total:
            changed = [*range(self.rank + 1, len(domains))]
        self._sizes = [len(domains[rank]) for rank in changed]
        self._starts = np.cumsum([0, *self._sizes])
        self._changed: NDArray[np.intp] | slice = slice(0, self._total)
        self._all = int(self._starts[-1]) == self._total
        if not self._all:
            starts = [columns.start(rank - self.rank - 1) for rank in changed]
            parts = [np.arange(start, start + size) for start, size in zip(starts, self._sizes, strict=True)]
            self._changed = np.concatenate([np.arange(0), *parts])
        self._prices: NDArray[Any] = np.zeros((self._own, self._starts[-1]))
        self._n_ary: list[_NAry] = []
        self._rows: list[_Rows] = []
        place = {rank: place for place, rank in enumerate(changed)}
        for rank, table in found:
            vector = slice(int(self._starts[place[rank]]), int(self._starts[place[rank] + 1]))
            above_both = tuple([order.rank[one] for one in table.agents[:-1]])
            if isinstance(table, ConstraintRows):
                self.most += table.costs.most or 0
                self._rows.append(_Rows(above_both, vector, table.costs, problem))
                continue
            self.most += int(table.charges[np.isfinite(table.charges)].max(initial=0))
            if len(table.agents) == 1:
                self._prices[:, vector] += table.joined().T
            else:
                self._n_ary.append(_n_ary(table, above_both, vector))

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
        columns = self._first + self._own + self._total
        if count < 1 or len(content) != count * columns * self._type.itemsize:
            raise ValueError(f"{len(content)} bytes cannot contain {count} partial assignments")
        rows: Rows = np.frombuffer(content, self._type).reshape(count, columns)
        if (rows[:, VALUES : self._first] >= self._above).any() or (self._type.kind == "i" and (rows < 0).any()):
            raise ValueError("a partial assignment contains values that do not exist")
        return rows

    @property
    def width(self) -> int:
        """The number of bytes of an extended partial assignment."""
        return (self._first + 1 + self._total) * self._type.itemsize

    def below(self, rows: Rows, upper_bound: int) -> Rows:
        """Return the `rows` with a lower bound below `upper_bound`."""
        fit = rows[:, BOUND] < upper_bound
        return rows if fit.all() else rows[fit]

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
        others = rows[:, self._first + self._own :]
        old = others[:, self._changed]
        vectors = self._vectors(rows, old, row, value)
        costs = rows[row, COST].astype(np.int64) + own[row, value]
        bounds = costs + _totals(self._cheapest(vectors))
        if not self._all:  # the other vectors' part of the bound is as before
            bounds += (before - rows[:, COST] - _totals(self._cheapest(old)))[row]
        (kept,) = np.nonzero(bounds < upper_bound)
        left = _totals(vectors[kept])
        if not self._all and len(rows) > 1:
            left += (_totals(others) - _totals(old))[row[kept]]
        kept = kept[np.lexsort((left, bounds[kept]))]
        extended = np.empty((len(kept), self._first + 1 + self._total), self._type)
        extended[:, BOUND] = bounds[kept]
        extended[:, COST] = costs[kept]
        extended[:, VALUES : self._first] = rows[row[kept], VALUES : self._first]
        extended[:, self._first] = value[kept]
        after = extended[:, self._first + 1 :]
        if not self._all:
            after[:] = others[row[kept]]
        after[:, self._changed] = vectors[kept]
        return extended

    def completed(self, rows: Rows) -> tuple[int, list[int]]:
        """Return the cost and the values of the cheapest extension of `rows`, for all robots but this one."""
        costs = rows[:, COST, None].astype(np.int64) + rows[:, self._first :]
        row, value = divmod(int(costs.argmin()), self._own)
        return int(costs[row, value]), [*rows[row, VALUES : self._first].tolist(), value]

    def _vectors(self, rows: Rows, old: Rows, row: NDArray[np.intp], value: NDArray[np.intp]) -> Rows:
        """Return the changed vectors, `old` before, after each of the `rows` at `row` is extended by `value`."""
        vectors = old[row]
        vectors += self._prices[value]
        np.minimum(vectors, self.ceiling, out=vectors)
        for one in self._n_ary:
            costs = one.costs([rows[row, VALUES + rank] for rank in one.ranks], value)
            vectors[:, one.columns] = np.minimum(vectors[:, one.columns] + costs, self.ceiling)
        for each in self._rows:
            costs = each.costs.of([*(rows[row, VALUES + rank] for rank in each.ranks), value])
            each.problem.checks += costs.size
            vectors[:, each.columns] = np.minimum(vectors[:, each.columns] + costs, self.ceiling)
        return vectors

    def _cheapest(self, vectors: Rows) -> Rows:
        """Return the minimum of each robot's vector, of those that change."""
        if not self._sizes:
            return vectors
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


def _n_ary(table: CostTable, ranks: tuple[int, ...], columns: slice) -> _NAry:
    """Return `table` with its last axis for the lowest robot, not for this robot."""
    *above, lowest, own = [
        None if len(codes) == size else np.array(codes, np.intp)
        for codes, size in zip(table.codes, table.charges.shape, strict=True)
    ]
    return _NAry(ranks, columns, np.moveaxis(table.charges, -1, -2), (*above, own, lowest))


def _sizes(domains: Sequence[tuple[Domain, int]]) -> NDArray[Any] | int:
    """Return the sizes of `domains`, each with the number of its successive robots; one number if all are equal."""
    sizes = [len(domain) for domain, _ in domains]
    if len(set(sizes)) == 1:
        return sizes[0]
    small = np.array(sizes, np.min_scalar_type(max(sizes, default=0)))
    return np.repeat(small, [count for _, count in domains])


def _totals(rows: Rows) -> NDArray[np.int64]:
    totals: NDArray[np.int64] = rows.sum(axis=1, dtype=np.int64)
    return totals
