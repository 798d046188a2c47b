"""The layout of a team in arrays: robots with the same number of values form a group, sorted by descending degree.

Rows are numbered in this order; `ArrayLayout.robots` maps rows to robots. The cost of a value is one integer: the
number of violated constraints is in the high bits, the other costs are in the low bits (`IntegerCosts`), so that
integers compare like `LexicographicCost`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from robochoc.communication.arrays.array_types import Flags, Floats, Index, Integers
from robochoc.communication.arrays.compiled import sort_order
from robochoc.communication.arrays.description import Description, KnownConstraints
from robochoc.communication.arrays.jagged import columns, narrowest, segments
from robochoc.solver.errors import TooLargeError
from robochoc.solver.exact_costs import check_exact
from robochoc.system.lazy_dataclass import dataclass

ROWS_PADDING = 3
"""The number of unused entries after tables, which `_kernels.c` may read."""
_SIGNED_BITS = 63
_LOW_BITS = 31
_LOW = (1 << _LOW_BITS) - 1


@dataclass(frozen=True)
class IntegerCosts:
    """Costs as integers: the number of violated constraints, shifted by `bits`, plus all other costs.

    A difference between two sums has the same form. Its other costs may be negative, and are less than half of the
    unit.
    """

    bits: int
    kind: np.dtype[np.integer]

    @classmethod
    def up_to(cls, total: float, constraints: int) -> IntegerCosts:
        """Return the form for robots with at most `constraints` constraints and a total cost of at most `total`.

        Raises:
            TooLargeError: if the costs do not fit into 64 bits.
        """
        check_exact(total)
        bits = (4 * int(total) + 1).bit_length()
        largest = 4 * (constraints + 1) << bits
        if largest >= 1 << 62:
            raise TooLargeError(
                f"costs of up to {int(total):,} and up to {constraints:,} broken constraints of a robot do not fit into"
                " 64 bits"
            )
        return cls(bits, np.dtype(np.int32 if largest < 1 << 31 else np.int64))

    def of(self, costs: Floats) -> Integers:
        """Return `costs` in this form. `inf` means a violated constraint."""
        broken = np.isinf(costs)
        return (np.where(broken, 0, costs).astype(np.int64) + (broken.astype(np.int64) << self.bits)).astype(self.kind)

    def sum(self, costs: Integers) -> int:
        """Return the sum of `costs`. It may exceed 64 bits."""
        if len(costs) << self.bits < 1 << _SIGNED_BITS:
            return int(costs.sum(dtype=np.int64))
        low = int((costs & _LOW).sum(dtype=np.int64))
        return low + (int((costs >> _LOW_BITS).sum(dtype=np.int64)) << _LOW_BITS)

    def broken(self, costs: Integers) -> Integers:
        """Return the numbers of violated constraints, in sums or differences."""
        half = (1 << self.bits) >> 1
        return (costs.astype(np.int64) + half) >> self.bits

    def paid(self, costs: Integers) -> Integers:
        """Return the costs other than violated constraints."""
        return costs.astype(np.int64) - (self.broken(costs) << self.bits)


@dataclass(frozen=True)
class Column:
    """One constraint for each of many robots (`lists`, numbered within their group).

    The costs of the robot's values are in the row `base` + the sum of `strides` times the others' values.
    """

    lists: Index
    base: Integers | int
    others: tuple[Integers, ...]
    strides: tuple[int, ...]

    def rows(self, values: Integers) -> Integers:
        """Return the row of each robot's constraint for these `values`."""
        if isinstance(self.base, int) and not self.base and self.strides == (1,):
            return values.take(self.others[0])
        total = np.zeros(len(self.others[0]), np.int64) + self.base
        for other, stride in zip(self.others, self.strides, strict=True):
            total += values.take(other).astype(np.int64) * stride
        return total


@dataclass(frozen=True)
class ConstraintBlock:
    """Constraints with one shape, known by robots in one group, robot by robot.

    Attributes:
        held: The constraints in the order of the description.
        rows: A row of costs per combination of others' values.
        lengths: The number of constraints of each robot.
        bases: The index of the first row of each constraint's table. None: there is one table.
        others: The rows of the other robots in each scope.
        strides: The factors of their values in the index of a row.
    """

    held: KnownConstraints
    rows: Integers
    lengths: Integers
    bases: Integers | None
    others: Integers
    strides: tuple[int, ...]

    @cached_property
    def columns(self) -> list[Column]:
        """The constraints, column by column."""
        return [
            Column(
                lists,
                0 if self.bases is None else self.bases[places],
                tuple(np.ascontiguousarray(self.others[places].T)),
                self.strides,
            )
            for lists, places in columns(self.lengths)
        ]


@dataclass
class RobotGroup:
    """The robots with `size` values: rows `first` to `last` in the team's arrays. The first `active` have neighbours.

    `charges` contains the unary cost of each value; None: no unary costs. `fixed` also includes constraints over no
    other robot. `checks` is the number of constraint checks for evaluating all values of each robot.
    """

    size: int
    first: int
    last: int
    active: int
    charges: Integers | None
    fixed: Integers | None = None
    checks: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    blocks: list[ConstraintBlock] = field(default_factory=list)

    @property
    def many(self) -> int:
        """The number of robots."""
        return self.last - self.first

    def values(self, values: Integers) -> Integers:
        """Return this group's part of the team's `values`."""
        return values[self.first : self.last]


class ArrayLayout:
    """The arrays of a team.

    Attributes:
        description: The team.
        costs: The integer form of its costs.
        robots: The robot in each row.
        places: The row of each robot; -1 for robots without values.
        groups: The groups of robots with the same number of values, in ascending order of that number.
        degrees: The number of neighbours of the robot in each row.

    Args:
        description: The team, or a block of it.
        costs: The integer form of costs, if the team is larger than `description`.
    """

    def __init__(self, description: Description, costs: IntegerCosts | None = None) -> None:
        self.description = description
        sizes, degrees = description.sizes, description.degrees
        most = int(degrees.max(initial=0))
        order = sort_order(sizes * (most + 1) + most - degrees)
        self.robots = order[np.searchsorted(sizes[order], 1) :]
        self.places = np.full(len(sizes), -1, np.int64)
        self.places[self.robots] = np.arange(len(self.robots))
        self.empty = np.flatnonzero(sizes == 0)
        self.degrees = degrees[self.robots]
        self.kind = narrowest(int(sizes.max(initial=1)))
        held = [] if self.empty.size else list(description.held)
        self.costs = costs or cost_form(description)
        self.groups = list(self._groups(held))

    @property
    def many(self) -> int:
        """The number of robots with values."""
        return len(self.robots)

    @cached_property
    def index(self) -> np.dtype[np.integer]:
        """The integer type for row numbers."""
        return np.dtype(np.int32 if self.many < np.iinfo(np.int32).max else np.int64)

    @cached_property
    def starts(self) -> Integers:
        """The index of each row's first neighbour in `neighbours`."""
        return np.cumsum(self.degrees) - self.degrees

    @cached_property
    def neighbours(self) -> Integers:
        """The rows of the neighbours of the robot in row 0, in priority order, then those for row 1, and so on."""
        given = self.description
        starts = np.cumsum(given.degrees) - given.degrees
        entries = np.repeat(starts[self.robots] - self.starts, self.degrees) + np.arange(self.degrees.sum())
        rows: Integers = self.places[given.neighbours[entries]].astype(self.index)
        return rows

    @cached_property
    def links(self) -> list[tuple[RobotGroup, Index, Integers, Integers]]:
        """Each group's neighbours, by column: the robots (within the group), the neighbours, the links' indices."""
        return [
            (group, lists, self.neighbours[places + self._start(group)], places + self._start(group))
            for group in self.groups
            for lists, places in columns(self.degrees[group.first : group.last])
        ]

    @cached_property
    def higher(self) -> list[Flags]:
        """For each column of `links`, whether the neighbour precedes the robot in the order."""
        return [
            self.robots[neighbours] < self.robots[group.first : group.last][lists]
            for group, lists, neighbours, _ in self.links
        ]

    def link(self, robots: Integers, neighbours: Integers) -> Integers:
        """Return the indices in `neighbours` of the links from `robots` to `neighbours`."""
        keys, order = self._links_sorted
        found: Integers = order[np.searchsorted(keys, robots.astype(np.int64) * self.many + neighbours)]
        return found

    @cached_property
    def back(self) -> Integers:
        """For each link, the index of the link in the opposite direction."""
        return self.link(self.neighbours, segments(self.degrees)).astype(self.index)

    @cached_property
    def _links_sorted(self) -> tuple[Integers, Integers]:
        keys = segments(self.degrees) * self.many + self.neighbours
        order = np.argsort(keys, kind="stable")
        return keys[order], order

    def _start(self, group: RobotGroup) -> int:
        return int(self.starts[group.first]) if group.many else 0

    def _groups(self, held: list[KnownConstraints]) -> Iterator[RobotGroup]:
        sizes = self.description.sizes[self.robots]
        of = [(one, one.owners.size and one.tables.shape[-1]) for one in held]
        for size in np.unique(sizes):
            first, last = (int(np.searchsorted(sizes, size, side)) for side in ("left", "right"))
            active = int((self.degrees[first:last] > 0).sum())
            group = RobotGroup(int(size), first, last, active, self._charges(first, last, int(size)))
            self._fill(group, [one for one, own in of if own == size])
            yield group

    def _charges(self, first: int, last: int, size: int) -> Integers | None:
        given = self.description
        if given.charges is None or not given.charges.any():
            return None
        starts = (np.cumsum(given.sizes) - given.sizes)[self.robots[first:last]]
        return self.costs.of(given.charges[starts[:, None] + np.arange(size)])

    def _fill(self, group: RobotGroup, held: list[KnownConstraints]) -> None:
        """Add the group's constraints to the group."""
        group.checks = np.zeros(group.many, np.int64)
        group.fixed = group.charges
        for one in held:
            own = self.places[one.owners] - group.first
            group.checks += np.bincount(own, minlength=group.many) * group.size
            padded = np.zeros(one.tables.size + ROWS_PADDING, self.costs.kind)
            padded[: one.tables.size] = self.costs.of(one.tables).ravel()
            rows = padded[: one.tables.size].reshape(-1, group.size)
            if one.others.shape[1]:
                group.blocks.append(self._block(group, one, own, rows))
            else:
                fixed = np.zeros((group.many, group.size), self.costs.kind) if group.fixed is None else group.fixed
                group.fixed = fixed.copy()
                np.add.at(group.fixed, own, rows[one.which])

    def _block(self, group: RobotGroup, held: KnownConstraints, own: Integers, rows: Integers) -> ConstraintBlock:
        order = sort_order(own)
        shape = held.tables.shape[1:-1]
        strides = tuple(int(np.prod(shape[place + 1 :])) for place in range(len(shape)))
        per_table = int(np.prod(shape))
        bases = (held.which[order] * per_table).astype(self.index) if len(held.tables) > 1 else None
        others = self.places.astype(self.index)[held.others[order]]
        return ConstraintBlock(held, rows, np.bincount(own, minlength=group.many), bases, others, strides)


def cost_form(description: Description) -> IntegerCosts:
    """Return the integer form of the costs of a team. Raises `TooLargeError` if the costs do not fit into 64 bits."""
    held = () if (description.sizes == 0).any() else description.held
    return IntegerCosts.up_to(*_largest(description, held))


def _largest(description: Description, held: Sequence[KnownConstraints]) -> tuple[float, int]:
    """Return the largest possible sum of a robot's costs, and number of its violated constraints."""
    many = len(description.sizes)
    total, constraints = np.zeros(many), np.zeros(many, np.int64)
    if description.charges is not None and len(description.charges):
        finite = np.where(np.isinf(description.charges), 0, description.charges)
        np.maximum.at(total, segments(description.sizes), finite)
    for one in held:
        finite = np.where(np.isinf(one.tables), 0, one.tables).reshape(len(one.tables), -1)
        most = finite.max(axis=1, initial=0)
        total += np.bincount(one.owners, most[one.which], many)
        constraints += np.bincount(one.owners, minlength=many)
    return float(total.max(initial=0)), int(constraints.max(initial=0))
