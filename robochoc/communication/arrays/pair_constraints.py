"""The constraints that pairs of neighbours share, for many pairs at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robochoc.communication.arrays.array_types import Integers
from robochoc.communication.arrays.layout import Block, Group, Layout


@dataclass(frozen=True)
class _Position:
    """The constraints of a block, sorted by the link from their owner to the robot at one position.

    The constraints of link n are at `starts[n]` to `starts[n + 1]`.
    """

    starts: Integers
    constraints: Integers
    stride: int


class _Constraints:
    """The constraints of a block: `rows` as in `Column`, and the robots at each position."""

    def __init__(self, layout: Layout, block: Block) -> None:
        held = block.held
        shape = held.tables.shape[1:-1]
        self.costs = block.rows
        self._base = held.which * int(np.prod(shape))
        self._others = layout.places[held.others]
        self._strides = np.array([int(np.prod(shape[place + 1 :])) for place in range(len(shape))])
        owners = layout.places[held.owners]
        self.positions = []
        for place, stride in enumerate(self._strides.tolist()):
            links = layout.link(owners, self._others[:, place])
            order = np.argsort(links, kind="stable")
            starts = np.searchsorted(links[order], np.arange(len(layout.neighbours) + 1))
            self.positions.append(_Position(starts.astype(layout.index), order, stride))

    def rows(self, values: Integers, constraints: Integers) -> Integers:
        """Return the row of costs of each of `constraints` under these `values`."""
        others = values[self._others[constraints]].astype(np.int64)
        found: Integers = self._base[constraints] + others @ self._strides
        return found


class _Meeting(NamedTuple):
    """One constraint for each of some of the requested pairs (`pairs`, without duplicates)."""

    pairs: Integers
    rows: Integers
    stride: int
    costs: Integers


class PairConstraints:
    """The constraints of the robots of one group, by their other robots."""

    def __init__(self, layout: Layout, group: Group) -> None:
        self._constraints = [_Constraints(layout, block) for block in group.blocks]
        self.size = group.size

    def count(self, links: Integers) -> Integers:
        """Return, for each of `links`, the number of its owner's constraints over the neighbour."""
        found = np.zeros(len(links), np.int64)
        for constraints in self._constraints:
            for position in constraints.positions:
                first, last = _span(position, links)
                found += last - first
        return found

    def without(self, links: Integers, values: Integers, value_costs: Integers) -> Integers:
        """Return `value_costs` (of each link's owner) without the constraints over the neighbour."""
        left = value_costs.copy()
        for meeting in self._meetings(links, values):
            left[meeting.pairs] -= meeting.costs[meeting.rows]
        return left

    def with_any(self, links: Integers, values: Integers, value_costs: Integers, own: Integers, many: int) -> Integers:
        """Return the `value_costs` of each link's owner for each of the `many` values that its neighbour may have.

        `own` are the neighbours' present values.
        """
        found = np.repeat(self.without(links, values, value_costs)[:, None, :], many, axis=1)
        for meeting in self._meetings(links, values):
            first = meeting.rows - meeting.stride * own[meeting.pairs].astype(np.int64)
            for value in range(many):
                found[meeting.pairs, value] += meeting.costs[first + meeting.stride * value]
        return found

    def _meetings(self, links: Integers, values: Integers) -> Iterator[_Meeting]:
        for constraints in self._constraints:
            for position in constraints.positions:
                first, last = _span(position, links)
                for number in range(int((last - first).max(initial=0))):
                    pairs = np.flatnonzero(last - first > number)
                    met = position.constraints[first[pairs] + number]
                    yield _Meeting(pairs, constraints.rows(values, met), position.stride, constraints.costs)


def _span(position: _Position, links: Integers) -> tuple[Integers, Integers]:
    return position.starts[links].astype(np.int64), position.starts[links + 1].astype(np.int64)
