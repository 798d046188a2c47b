"""Function nodes of Max-Sum as arrays: `protocols/inference/maxsum_factor.py` for all functions of a team at once."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np

from robochoc.communication.arrays.array_types import FEW, Floats, Index, Integers
from robochoc.communication.arrays.cycle_run import exact_sum
from robochoc.communication.arrays.description import KnownConstraints
from robochoc.communication.arrays.jagged import columns
from robochoc.communication.arrays.layout import Group, Layout

_CHUNK = 1 << 20
"""The number of table entries in one step: they fit into the processor's cache."""


@dataclass(frozen=True)
class Factors:
    """Functions of one shape: each is the sum of all constraints over the same robots.

    `rows` are their robots, a column for each place, the holder last; `numbers` are their places among all functions of
    the holder; `which` is the number of each one's table.
    """

    rows: Integers
    numbers: Integers
    tables: Floats
    which: Integers

    def least(self, told: list[Floats], place: int) -> Floats:
        """Return R: the minimum cost for each value of the robots at `place`, given the others' Q in `told`."""
        shape = self.tables.shape[1:]
        found = np.empty((len(self.rows), shape[place]))
        step = max(1, _CHUNK // int(np.prod(shape)))
        for first in range(0, len(self.rows), step):
            part = slice(first, first + step)
            total = self.tables if len(self.tables) == 1 else self.tables[self.which[part]]
            for axis, row in enumerate(told):
                if axis != place:
                    wide = [1] * len(shape)
                    wide[axis] = shape[axis]
                    total = total + row[part].reshape(-1, *wide)
            for axis in reversed(range(len(shape))):
                total = total if axis == place else _least(total, axis + 1)
            found[part] = total
        return found

    def cost(self, values: Integers) -> float:
        """Return the sum of all functions under these `values`."""
        return exact_sum(self.tables[(self.which, *(values[column] for column in self.rows.T))])


def factors_of(layout: Layout) -> list[Factors]:
    """Return the functions of a team. The lowest robot of a scope holds its function."""
    return [found for held in layout.description.held if (found := _joined(layout, held)) is not None]


def _joined(layout: Layout, held: KnownConstraints) -> Factors | None:
    """Return the functions of the constraints in `held` whose owner is the lowest; None if there are none."""
    if not held.others.shape[1]:
        return None
    kept = np.flatnonzero(held.owners > held.others.max(axis=1))
    if not kept.size:
        return None
    scopes = np.column_stack([held.others[kept], held.owners[kept]])
    order = np.lexsort((held.numbers[kept], *scopes.T))
    fresh = np.ones(len(order), bool)
    fresh[1:] = (scopes[order[1:]] != scopes[order[:-1]]).any(axis=1)
    first = order[fresh]
    which, tables = held.which[kept], held.tables
    if len(first) < len(order):
        tables = np.zeros((len(first), *held.tables.shape[1:]))
        np.add.at(tables, np.cumsum(fresh) - 1, held.tables[which[order]])
        which = np.zeros(len(kept), np.int64)
        which[first] = np.arange(len(first))
    return Factors(layout.places[scopes[first]], held.numbers[kept][first], tables, which[first])


def _least(costs: Floats, axis: int) -> Floats:
    """Return the minimum along `axis`; for a short axis, a loop is faster than numpy's."""
    if costs.shape[axis] > FEW:
        return cast("Floats", costs.min(axis=axis))
    rows = np.moveaxis(costs, axis, 0)
    found: Floats = rows[0].copy()
    for row in rows[1:]:
        np.minimum(found, row, out=found)
    return found


@dataclass
class Ports:
    """The edges between functions and the variables of one group of robots: a row for each edge.

    `r` and `q` are the last messages from and to the functions. `owners` are the robots (numbered in their group),
    `slots` the edges of each robot, one robot after the other, in the order in which their costs are added up.
    """

    group: Group
    owners: Integers
    slots: Integers
    lengths: Integers
    r: Floats
    q: Floats

    def columns(self) -> Iterator[tuple[Index, Integers]]:
        """Yield robots and edges, column by column."""
        for lists, places in columns(self.lengths):
            yield lists, self.slots[places]

    def without(self, rows: Integers, preferred: Floats) -> Iterator[tuple[Integers, Floats]]:
        """Yield edges of `rows`, with the sum of the costs of their values by all other functions."""
        starts, lengths = (np.cumsum(self.lengths) - self.lengths)[rows], self.lengths[rows]
        for left_out in range(int(lengths.max(initial=0))):
            there = lengths > left_out
            total = preferred[rows[there]].copy()
            for column in range(int(lengths.max())):
                more = lengths[there] > column
                if column != left_out:
                    total[more] += self.r[self.slots[starts[there][more] + column]]
            yield self.slots[starts[there] + left_out], total


def ports_of(layout: Layout, factors: list[Factors]) -> tuple[list[Ports], list[list[tuple[Ports, slice]]]]:
    """Return the ports of each group, and for each of `factors` the ports and rows of its robots."""
    found: list[Ports] = []
    sides: list[list[tuple[Ports, slice]]] = [[] for _ in factors]
    for group in layout.groups:
        ends = [
            (number, place)
            for number, one in enumerate(factors)
            for place, size in enumerate(one.tables.shape[1:])
            if size == group.size
        ]
        ports, slices = _ports(layout, group, [(factors[number], place) for number, place in ends])
        found.append(ports)
        for (number, _), rows in zip(ends, slices, strict=True):
            sides[number].append((ports, rows))
    return found, [_by_place(one, side) for one, side in zip(factors, sides, strict=True)]


def _by_place(factors: Factors, sides: list[tuple[Ports, slice]]) -> list[tuple[Ports, slice]]:
    """Return `sides`, which are sorted by size, in the order of the robots."""
    sizes = factors.tables.shape[1:]
    order = sorted(range(len(sizes)), key=lambda place: sizes[place])
    return [side for _, side in sorted(zip(order, sides, strict=True), key=lambda pair: pair[0])]


def _ports(layout: Layout, group: Group, ends: list[tuple[Factors, int]]) -> tuple[Ports, list[slice]]:
    """Return the ports of `group` at `ends`: functions with the places of their robots."""
    owners = [one.rows[:, place] - group.first for one, place in ends]
    holders = [np.where(place == one.rows.shape[1] - 1, -1, layout.robots[one.rows[:, -1]]) for one, place in ends]
    bounds = np.cumsum([0, *(len(one.rows) for one, _ in ends)])
    empty = np.zeros(0, np.int64)
    all_owners = np.concatenate([empty, *owners])
    numbers = np.concatenate([empty, *(one.numbers for one, _ in ends)])
    slots = np.lexsort((numbers, np.concatenate([empty, *holders]), all_owners))
    lengths = np.bincount(all_owners, minlength=group.many)
    r, q = (np.zeros((len(all_owners), group.size)) for _ in range(2))
    parts = [slice(first, last) for first, last in itertools.pairwise(bounds.tolist())]
    return Ports(group, all_owners, slots, lengths, r, q), parts
