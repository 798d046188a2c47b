"""Max-Sum for all robots at once. `protocols/inference/maxsum.py` explains the algorithm.

Sums are computed in the same order as for robots as objects, so that rounding is the same.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import cast

import numpy as np

from robochoc.communication.arrays.array_types import FEW, Floats, Index, Integers
from robochoc.communication.arrays.border import Shared
from robochoc.communication.arrays.cycle_run import CycleRun, exact_sum, least
from robochoc.communication.arrays.description import KnownConstraints
from robochoc.communication.arrays.jagged import columns
from robochoc.communication.arrays.layout import ArrayLayout, RobotGroup
from robochoc.communication.arrays.maxsum_border import Edges, shared_edges
from robochoc.communication.arrays.tally import list_bytes
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.inference.maxsum import MaxSumSettings, Q, R
from robochoc.protocols.inference.maxsum_factor import MOST
from robochoc.protocols.message import encode
from robochoc.protocols.shared.cycles import CycleCount, Domain
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.exact_costs import EXACT
from robochoc.system.lazy_dataclass import dataclass

_CHUNK = 1 << 20
"""The number of table entries in one step, chosen to fit into the processor's cache."""


@dataclass(frozen=True)
class Factors:
    """Function nodes with one shape (`protocols/inference/maxsum_factor.py`). Each node is a sum of constraints.

    `rows` contains their robots, one column per position, with the holder last. `numbers` contains their indices among
    all functions of the holder, `which` the index of each table.
    """

    rows: Integers
    numbers: Integers
    tables: Floats
    which: Integers

    def least(self, received: list[Floats], place: int) -> Floats:
        """Return R: the minimum cost for each value of the robots at `place`, given the others' Q in `received`."""
        shape = self.tables.shape[1:]
        found = np.empty((len(self.rows), shape[place]))
        step = max(1, _CHUNK // int(np.prod(shape)))
        for first in range(0, len(self.rows), step):
            part = slice(first, first + step)
            total = self.tables if len(self.tables) == 1 else self.tables[self.which[part]]
            for axis, row in enumerate(received):
                if axis != place:
                    wide = [1] * len(shape)
                    wide[axis] = shape[axis]
                    total = total + row[part].reshape(-1, *wide)
            for axis in reversed(range(len(shape))):
                total = total if axis == place else _least(total, axis + 1)
            found[part] = total
        return found

    def cost(self, values: Integers, number: int, blocks: Integers | None) -> float:
        """Return the sum of all functions for these `values`, or of those held in the block `number` of `blocks`."""
        rows, which = self.rows, self.which
        if blocks is not None:
            held = blocks[rows[:, -1]] == number
            rows, which = rows[held], which[held]
        return exact_sum(self.tables[(which, *(values[column] for column in rows.T))])


def factors_of(layout: ArrayLayout) -> list[Factors]:
    """Return the functions of a team. The lowest robot in a scope holds the function."""
    return [found for held in layout.description.held if (found := _joined(layout, held)) is not None]


def _joined(layout: ArrayLayout, held: KnownConstraints) -> Factors | None:
    """Return the functions for the constraints in `held` whose owner is the lowest robot; None if there are none."""
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
    """Return the minimum along `axis`. For a short axis, a loop is faster than numpy's."""
    if costs.shape[axis] > FEW:
        return cast("Floats", costs.min(axis=axis))
    rows = np.moveaxis(costs, axis, 0)
    found: Floats = rows[0].copy()
    for row in rows[1:]:
        np.minimum(found, row, out=found)
    return found


@dataclass
class Ports:
    """The edges between functions and the variables in one group of robots, with one row per edge.

    `r` and `q` are the last messages from and to the functions. `owners` are the robots (numbered within their group),
    `slots` are the edges of each robot, robot by robot, in the order in which their costs are added.
    """

    group: RobotGroup
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
        """Yield edges in `rows`, with the costs of their values summed over all other functions."""
        starts, lengths = (np.cumsum(self.lengths) - self.lengths)[rows], self.lengths[rows]
        for left_out in range(int(lengths.max(initial=0))):
            there = lengths > left_out
            total = preferred[rows[there]].copy()
            for column in range(int(lengths.max())):
                more = lengths[there] > column
                if column != left_out:
                    total[more] += self.r[self.slots[starts[there][more] + column]]
            yield self.slots[starts[there] + left_out], total


def ports_of(layout: ArrayLayout, factors: list[Factors]) -> tuple[list[Ports], list[list[tuple[Ports, slice]]]]:
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
    """Return `sides` (sorted by size) in the order of the robots."""
    sizes = factors.tables.shape[1:]
    order = sorted(range(len(sizes)), key=lambda place: sizes[place])
    return [side for _, side in sorted(zip(order, sides, strict=True), key=lambda pair: pair[0])]


def _ports(layout: ArrayLayout, group: RobotGroup, ends: list[tuple[Factors, int]]) -> tuple[Ports, list[slice]]:
    """Return the ports of `group` at `ends`, which are functions with the positions of their robots."""
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


_REST = len(encode(R([]))) - 1
"""The size of a message without its list of rows, in bytes."""
_FLOAT = 9


class ArrayMaxSum(CycleRun):
    """A run of Max-Sum.

    Raises:
        UnsupportedError: if functions are to be split or reweighted, or costs to be diffused.
    """

    in_blocks = True
    functions_in_blocks = True

    def __init__(
        self, layout: ArrayLayout, settings: CycleCount, seed: int, *, clocks: bool = True, changes: bool = False
    ) -> None:
        settings = cast("MaxSumSettings", settings)
        refused = {
            "split": settings.split > 0,
            "reweight": settings.reweight != 1,
            "diffusion": settings.diffusion == "yes",
        }
        for name, used in refused.items():
            if used:
                raise UnsupportedError(f"maxsum with --set {name} has no array implementation: use --runtime simulator")
        super().__init__(layout, settings, seed, clocks=clocks, changes=changes)
        self._alone = [self._cost_alone(group) for group in layout.groups]
        self._factors = [] if layout.empty.size else factors_of(layout)
        self._ports, self._sides = ports_of(layout, self._factors)
        self._preferred: list[Floats] = []

    def _start_active(self) -> None:
        """Choose the cheapest values, send domains, and build functions (`MaxSum._make_functions`)."""
        self._preferred = [self._prefer(group) for group in self.layout.groups]
        for group, preferred in zip(self.layout.groups, self._preferred, strict=True):
            active = slice(group.first, group.first + group.active)
            self.values[active] = preferred[: group.active].argmin(axis=1).astype(self.layout.kind)
        self._count_links()
        lengths = self.layout.description.domain_bytes
        if isinstance(lengths, np.ndarray):
            lengths = lengths[self.layout.robots]
        self.tally.add(Domain.__name__, lengths, self._below)
        self._count_tables()

    def _step(self) -> None:
        """Send R, decide values, send Q (`MaxSum._send_r`, `MaxSum._decide`)."""
        self._weigh()
        self._send_r()
        z = self._z()
        self._share_verdict()
        if self.verdict is not None:
            return
        for group, costs in zip(self.layout.groups, z, strict=True):
            active = slice(group.first, group.first + group.active)
            self.values[active] = costs[: group.active].argmin(axis=1).astype(self.layout.kind)
        if self.cycle + 1 < self.settings.cycles:
            self._send_q(z)

    def _weigh(self) -> None:
        border = self.border
        total = sum(factors.cost(self.values, border.number, border.blocks) for factors in self._factors)
        for group, alone in zip(self.layout.groups, self._alone, strict=True):
            if alone is not None:
                total += exact_sum(alone[np.arange(group.many), group.values(self.values)])
        self.note(_total(border.gather(total)))

    # Equations

    def _prefer(self, group: RobotGroup) -> Floats:
        """Return the unary cost of each value, including its preference (gamma)."""
        rows = np.arange(group.first, group.first + group.active)
        preferred = np.zeros((group.many, group.size))
        preference = cast("MaxSumSettings", self.settings).preference
        for place in range(group.size):
            preferred[: group.active, place] = preference * self.draws.draw(rows)
        alone = self._cost_alone(group)
        return preferred if alone is None else alone + preferred

    def _send_r(self) -> None:
        """Compute R for all functions (2)."""
        for factors, sides in zip(self._factors, self._sides, strict=True):
            received = [ports.q[rows] for ports, rows in sides]
            for place, (ports, rows) in enumerate(sides):
                ports.r[rows] = factors.least(received, place)
        self.tally.add(R.__name__, self._link_bytes, np.ones_like(self._link_bytes))
        self._raise_clocks(below=True)

    def _z(self) -> list[Floats]:
        """Return the cost of each value (3)."""
        found = []
        for ports, preferred in zip(self._ports, self._preferred, strict=True):
            z = preferred.copy()
            for lists, slots in ports.columns():
                z[lists] += ports.r[slots]
            found.append(z)
            hopeless = np.flatnonzero(np.isinf(least(z[: ports.group.active])))
            if hopeless.size:
                self.verdict = Verdict.NO_SOLUTION
                self.witness = ports.group.first + int(hopeless[0])
        return found

    def _share_verdict(self) -> None:
        """Find the robot with the verdict, among all blocks: the first row of the last group."""
        row, border, found = self.witness, self.border, None
        if row is not None:
            local = self.layout.robots[row]
            robot = local if border.blocks is None else border.robots[row]
            found = [int(self.layout.description.sizes[local]), int(self.layout.degrees[row]), -int(robot)]
        witnesses = [one for one in border.gather(found) if one is not None]
        if witnesses:
            self.verdict, self.witness = Verdict.NO_SOLUTION, -max(witnesses)[-1]

    def _send_q(self, z: list[Floats]) -> None:
        """Compute Q for all variables (1), normalised and damped."""
        damping = cast("MaxSumSettings", self.settings).damping
        for ports, preferred, costs in zip(self._ports, self._preferred, z, strict=True):
            fresh = _fresh(ports, preferred, costs)
            fresh -= least(fresh)[:, None]
            np.minimum(fresh, MOST, out=fresh, where=fresh < INFINITE)
            ports.q = damping * ports.q + (1 - damping) * fresh if self.cycle and damping else fresh
        self._exchange_q()
        self.tally.add(Q.__name__, self._link_bytes, np.ones_like(self._link_bytes))
        self._raise_clocks(below=False)

    def _exchange_q(self) -> None:
        """Exchange Q on the edges of functions with robots in several blocks, and clocks."""
        self.border.exchange(self.clocks)
        edges = self._shared_edges
        self.border.swap([Shared(one.group.size, one.q, *edges[one.group.size]) for one in self._ports])

    @cached_property
    def _shared_edges(self) -> Mapping[int, tuple[Edges, Edges]]:
        return shared_edges(self.border, self._factors, self._sides)

    # Counts

    def _cost_alone(self, group: RobotGroup) -> Floats | None:
        if group.fixed is None:
            return None
        broken, paid = self.layout.costs.broken(group.fixed), self.layout.costs.paid(group.fixed)
        return np.where(broken > 0, INFINITE, paid.astype(np.float64))

    def _count_links(self) -> None:
        """Count the robots above and below each robot, and the sizes of the messages between two robots."""
        layout = self.layout
        self._below = np.zeros(layout.many, np.int64)
        higher = np.zeros(len(layout.neighbours), bool)
        for (group, lists, _, places), flags in zip(layout.links, layout.higher, strict=True):
            self._below[group.first : group.last][lists] += ~flags
            higher[places] = flags
        rows = np.zeros(len(higher), np.int64)
        for factors in self._factors:
            own = factors.rows[layout.degrees[factors.rows[:, -1]] > 0]  # without holders in other blocks
            for column in own.T[:-1]:
                rows += np.bincount(layout.link(own[:, -1], column), minlength=len(rows))
        sizes = layout.description.sizes[layout.robots][layout.neighbours]
        lengths = _REST + list_bytes(rows) + rows * (list_bytes(sizes) + _FLOAT * sizes)
        self._link_bytes: Integers = lengths[higher]

    def _count_tables(self) -> None:
        """Count the checks for the tables when all domains are known."""
        layout = self.layout
        alone = np.zeros(layout.many, np.int64)
        for held in layout.description.held:
            if not held.others.shape[1] and not layout.empty.size:
                alone += np.bincount(layout.places[held.owners], minlength=layout.many) * held.tables.shape[-1]
        alone[layout.degrees == 0] = 0
        self.count_checks(alone)
        self.border.exchange(self.clocks)
        self._raise_clocks(below=False)
        made = layout.description.table_checks
        if made is None:
            made = alone
            for held in layout.description.held:
                holders = layout.places[held.owners[held.owners > held.others.max(axis=1, initial=-1)]]
                wide = held.others.shape[1] > 0
                made = made + np.bincount(holders, minlength=layout.many) * held.tables[0].size * wide
            self.count_checks(np.where(layout.degrees > 0, made, 0))
        else:
            self.count_checks(np.where(layout.degrees > 0, made[layout.robots], 0))

    def _raise_clocks(self, *, below: bool) -> None:
        """Advance clocks to the clocks of the robots below, or above, that have sent a message."""
        if self.clocks is not None:
            clocks_after = self.clocks.copy()
            for (group, lists, neighbours, _), higher in zip(self.layout.links, self.layout.higher, strict=True):
                part = clocks_after[group.first : group.last]
                received = np.where(higher != below, self.clocks.take(neighbours), 0)
                part[lists] = np.maximum(part[lists], received)
            self.clocks = clocks_after


def _total(parts: list[float]) -> float:
    """Return the sum of the costs in `parts`, which is an integer if a float would not be exact."""
    if len(parts) == 1 or INFINITE in parts:
        return max(parts)
    total = sum(map(int, parts))
    return float(total) if total < EXACT else total


def _fresh(ports: Ports, preferred: Floats, costs: Floats) -> Floats:
    """Return, for each edge, the cost of each value without the edge's function. It subtracts nothing from infinity."""
    endless = np.flatnonzero(np.isinf(costs).any(axis=1))
    with np.errstate(invalid="ignore"):
        fresh: Floats = costs.take(ports.owners, axis=0) - ports.r
    for slots, total in ports.without(endless, preferred):
        fresh[slots] = total
    return fresh
