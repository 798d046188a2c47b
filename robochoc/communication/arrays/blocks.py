"""Runs of one team in several blocks of robots, each in its own thread, process or machine.

A block has its own robots, and copies of their neighbours in other blocks. Copies are rows without neighbours and
constraints, so the arrays of a block are those of a team. Blocks exchange the entries of copied robots when robots
send messages (`Border.exchange`). Values, costs and counts are equal to those of a run in one piece: random numbers
depend on the robot, sums are exact, and robots keep their priority order.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from robochoc.communication.arrays.array_types import Flags, Integers
from robochoc.communication.arrays.border import Border, Item, Shared
from robochoc.communication.arrays.cycle_run import CycleChange, CycleRun, cycles_of
from robochoc.communication.arrays.description import Description, KnownConstraints
from robochoc.communication.arrays.layout import ArrayLayout, IntegerCosts, cost_form
from robochoc.communication.cluster_client import require_dask
from robochoc.communication.search_result import ClusterLostError
from robochoc.model.outcome import Metrics, Verdict
from robochoc.protocols.shared.cycles import CycleCount
from robochoc.system.lazy_dataclass import dataclass

MOST_LEVELS = 10_000
"""The number of breadth-first levels after which the remaining robots keep their order."""


class BlockLostError(ClusterLostError):
    """A block of the team is lost, so the other blocks cannot continue."""


class Channel(Protocol):
    """The connection between the blocks of one run."""

    def swap(self, outgoing: Mapping[int, bytes], senders: Collection[int]) -> Mapping[int, bytes]:
        """Send `outgoing` to blocks, and return the next content from each of the blocks `senders`.

        Raises:
            BlockLostError: if one of the blocks is lost.
        """


@dataclass(frozen=True)
class Block:
    """A block of a team.

    Attributes:
        number: The index of the block.
        robots: The index, in the team, of each robot in `description`.
        own: The block's own robots; the others are copies.
        description: The robots, in priority order.
        costs: The integer form of costs in all blocks.
        outgoing: The robots that other blocks copy, by block.
        incoming: The copied robots, by their own block.
        active: True if a robot of the team has neighbours.
        many: The number of blocks.
    """

    number: int
    robots: Integers
    own: Flags
    description: Description
    costs: IntegerCosts
    outgoing: Mapping[int, Integers]
    incoming: Mapping[int, Integers]
    active: bool
    many: int


class Limits(NamedTuple):
    """Limits on a run, checked after each cycle. None: no limit."""

    timeout_s: float | None = None
    messages: int | None = None


NO_LIMITS = Limits()


@dataclass
class BlockReport:
    """The result of a run for the robots of one block, or of all blocks.

    Attributes:
        robots: The robots with values.
        values: Their values in the last cycle.
        best: Their values in the best cycle.
        costs: The cost of the team in each cycle.
        cycle: The last cycle.
        is_over: False if a limit ended the run.
        verdict: See `CycleRun`.
        witness: See `CycleRun`.
        metrics: The metrics. Those of blocks together are sums and maxima.
        changes: The changed values in each cycle, by robot; None if they are not recorded.
    """

    robots: Integers
    values: Integers
    best: Integers
    costs: list[float]
    cycle: int
    is_over: bool
    verdict: Verdict | None
    witness: int | None
    metrics: Metrics
    changes: list[CycleChange] | None


def split_team(description: Description, many: int, *, functions: bool = False) -> list[Block]:
    """Split a team into at most `many` blocks of similar size with few links between them.

    `functions`: true if blocks also need the constraints of lower robots in other blocks with their own robots.

    Raises:
        UnsupportedError: if the costs are too large.
    """
    if (description.sizes == 0).any():
        many = 1
    blocks = _blocks(description, many)
    copies, costs = [], cost_form(description)
    number_of_blocks = int(blocks.max(initial=0)) + 1
    starts = np.cumsum(description.degrees) - description.degrees
    parts = []
    for number in range(number_of_blocks):
        own = np.flatnonzero(blocks == number)
        held = [(one, np.flatnonzero(_held_by(one, blocks == number, functions=functions))) for one in description.held]
        near = [description.neighbours[_entries(starts, description.degrees, own)]]
        near += [one.others[mine].ravel() for one, mine in held]
        copies.append(np.setdiff1d(np.concatenate(near), own))
        parts.append((own, held))
    active = bool(description.degrees.any())
    found = []
    for number, (own, held) in enumerate(parts):
        robots = np.union1d(own, copies[number])
        outgoing = {other: np.searchsorted(robots, one[blocks[one] == number]) for other, one in enumerate(copies)}
        incoming = {
            other: np.searchsorted(robots, copies[number][blocks[copies[number]] == other])
            for other in range(number_of_blocks)
        }
        is_own = blocks[robots] == number
        part = _part(description, robots, is_own, held)
        found.append(
            Block(number, robots, is_own, part, costs, _filled(outgoing), _filled(incoming), active, number_of_blocks)
        )
    return found


def _held_by(held: KnownConstraints, own: Flags, *, functions: bool) -> Flags:
    """Return the constraints that a block with its `own` robots needs."""
    mine = own[held.owners]
    if functions and held.others.shape[1]:
        mine |= own[held.others].any(axis=1) & (held.owners > held.others.max(axis=1))
    return mine


def _filled(robots: Mapping[int, Integers]) -> dict[int, Integers]:
    return {block: one for block, one in robots.items() if one.size}


def _part(
    description: Description, robots: Integers, is_own: Flags, held: Sequence[tuple[KnownConstraints, Integers]]
) -> Description:
    """Return the description of `robots`, in which those that are not the block's own have no neighbours."""
    given = description
    starts = np.cumsum(given.degrees) - given.degrees
    sizes = given.sizes[robots]
    values = _entries(np.cumsum(given.sizes) - given.sizes, given.sizes, robots)
    charges = None if given.charges is None else np.where(np.repeat(is_own, sizes), given.charges[values], 0)
    lengths, domains, checks = given.value_bytes, given.domain_bytes, given.table_checks
    return Description(
        names=[given.names[robot] for robot in robots.tolist()],
        sizes=sizes,
        degrees=np.where(is_own, given.degrees[robots], 0),
        neighbours=np.searchsorted(robots, given.neighbours[_entries(starts, given.degrees, robots[is_own])]),
        charges=charges,
        held=[_constraints(one, mine, robots) for one, mine in held if mine.size],
        value_bytes=lengths[values] if isinstance(lengths, np.ndarray) else lengths,
        domain_bytes=domains[robots] if isinstance(domains, np.ndarray) else domains,
        table_checks=None if checks is None else checks[robots],
        starts=None if given.starts is None else given.starts[robots],
    )


def _constraints(held: KnownConstraints, mine: Integers, robots: Integers) -> KnownConstraints:
    used, which = np.unique(held.which[mine], return_inverse=True)
    return KnownConstraints(
        np.searchsorted(robots, held.owners[mine]),
        np.searchsorted(robots, held.others[mine]),
        held.tables[used],
        which,
        held.numbers[mine],
    )


def _entries(starts: Integers, lengths: Integers, lists: Integers) -> Integers:
    """Return the indices of the entries of these `lists` in the concatenation of all lists."""
    some = lengths[lists]
    found: Integers = np.repeat(starts[lists] - np.cumsum(some) + some, some) + np.arange(some.sum())
    return found


def _blocks(description: Description, many: int) -> Integers:
    """Return the block of each robot: robots in their order, or breadth-first, whichever has fewer links between."""
    degrees, robots = description.degrees, len(description.sizes)
    owners = np.repeat(np.arange(robots), degrees)
    found, least = np.zeros(robots, np.int64), -1
    for order in (np.arange, lambda _: np.concatenate([*_levels(description)])):
        if many > 1 and least:
            rows = order(robots)
            ends = np.cumsum(degrees[rows] + 1)
            blocks = np.empty(robots, np.int64)
            blocks[rows] = (ends - 1) * many // ends[-1]
            cut = int((blocks[owners] != blocks[description.neighbours]).sum())
            if least < 0 or cut < least:
                found, least = np.unique(blocks, return_inverse=True)[1], cut
    return found


def _levels(description: Description) -> Iterator[Integers]:
    """Yield all robots in breadth-first order."""
    degrees = description.degrees
    starts = np.cumsum(degrees) - degrees
    seen = np.zeros(len(degrees), bool)
    level = np.zeros(0, np.int64)
    for _ in range(MOST_LEVELS):
        near = description.neighbours[_entries(starts, degrees, level)]
        level = np.unique(near[~seen[near]])
        if not level.size:
            level = np.array([seen.argmin()])
            if seen[level[0]]:
                return
        seen[level] = True
        yield level
    yield np.flatnonzero(~seen)


class BlockBorder(Border):
    """The border of `block`, with a channel to the other blocks."""

    def __init__(self, block: Block, layout: ArrayLayout, channel: Channel) -> None:
        self.active = block.active
        self._channel = channel
        self._all = [other for other in range(block.many) if other != block.number]
        self.number = block.number
        self.robots = block.robots[layout.robots]
        self.blocks = np.full(len(self.robots), block.number)
        self._outgoing = {other: layout.places[robots] for other, robots in block.outgoing.items()}
        self._incoming = {other: layout.places[robots] for other, robots in block.incoming.items()}
        for other, rows in self._incoming.items():
            self.blocks[rows] = other

    def exchange(self, *arrays: NDArray[Any] | None) -> None:
        """See `Border.exchange`."""
        given = [array for array in arrays if array is not None]
        self.swap([Shared(key, array, self._outgoing, self._incoming) for key, array in enumerate(given)])

    def swap(self, shared: Sequence[Shared]) -> None:
        """See `Border.swap`."""
        outgoing = {
            other: msgspec.msgpack.encode(
                {
                    key: (array.dtype.str, array[rows[other]].tobytes())
                    for key, array, rows, _ in shared
                    if other in rows
                }
            )
            for other in self._outgoing
        }
        for other, content in self._channel.swap(outgoing, self._incoming).items():
            parts = msgspec.msgpack.decode(content)
            for key, array, _, rows in shared:
                if other in rows and key in parts:
                    kind, numbers = parts[key]
                    array[rows[other]] = np.frombuffer(numbers, kind).reshape(-1, *array.shape[1:])

    def gather(self, item: Item) -> list[Item]:
        """See `Border.gather`."""
        content = json.dumps(item).encode()
        received = self._channel.swap(dict.fromkeys(self._all, content), self._all)
        items = {other: json.loads(one) for other, one in received.items()}
        items[self.number] = json.loads(content)
        return [items[other] for other in sorted(items)]


@dataclass(frozen=True)
class RunBlock:
    """Runs a block to the end, together with the other blocks.

    Attributes:
        form: The array form of the protocol.
        settings: The protocol's settings.
        seed: The seed of the robots' random numbers.
        limits: Limits on the run.
        clocks: True if NCCC clocks are computed.
        changes: True if changed values are recorded.
    """

    form: type[CycleRun]
    settings: CycleCount
    seed: int
    limits: Limits = NO_LIMITS
    clocks: bool = True
    changes: bool = False

    def __call__(self, block: Block, channel: Channel) -> BlockReport:
        """Return the report of the block. Raises `BlockLostError` if another block is lost."""
        layout = ArrayLayout(block.description, block.costs)
        for group in layout.groups:
            group.checks[~block.own[layout.robots[group.first : group.last]]] = 0
        run = self.form(layout, self.settings, self.seed, clocks=self.clocks, changes=self.changes)
        border = run.border = BlockBorder(block, layout, channel)
        began = time.monotonic()
        is_over = True
        for _ in cycles_of(run):
            elapsed_s = time.monotonic() - began
            if self.limits != NO_LIMITS and not run.is_over and _reached(run, border, self.limits, elapsed_s):
                is_over = False
                run.end()
                break
        return _report(block, run, time.monotonic() - began, is_over=is_over)


def _reached(run: CycleRun, border: Border, limits: Limits, elapsed_s: float) -> bool:
    """Return whether the run of all blocks has reached a limit."""
    is_late = limits.timeout_s is not None and elapsed_s > limits.timeout_s
    late, sent = zip(*border.gather((is_late, sum(run.tally.messages.values()))), strict=True)
    return any(late) or (limits.messages is not None and sum(sent) >= limits.messages)


def _report(block: Block, run: CycleRun, wall_s: float, *, is_over: bool) -> BlockReport:
    own, robots = block.own[run.layout.robots], block.robots[run.layout.robots]
    changes = None
    if run.changes is not None:
        changes = [CycleChange(robots[rows[own[rows]]], values[own[rows]]) for rows, values in run.changes]
    return BlockReport(
        robots[own],
        run.values[own],
        run.best[own],
        run.costs,
        run.cycle,
        is_over,
        run.verdict,
        run.witness,
        run.metrics(wall_s),
        changes,
    )


def run_on_cluster(place: str, description: Description, run: RunBlock) -> BlockReport:
    """See `cluster_blocks.run_on_cluster`. Raises `UnsupportedError` if Dask is not installed."""
    require_dask()
    from robochoc.communication.arrays import cluster_blocks  # noqa: PLC0415 - an extra

    return cluster_blocks.run_on_cluster(place, description, run)


def joined(reports: Sequence[BlockReport]) -> BlockReport:
    """Return the report of a team from the reports of all blocks."""
    first = reports[0]
    messages: Counter[str] = Counter()
    for one in reports:
        messages.update(one.metrics.messages)
    parts = [one.metrics for one in reports]
    return BlockReport(
        np.concatenate([one.robots for one in reports]),
        np.concatenate([one.values for one in reports]),
        np.concatenate([one.best for one in reports]),
        first.costs,
        first.cycle,
        first.is_over,
        first.verdict,
        first.witness,
        Metrics(
            messages=dict(sorted(messages.items())),
            bytes=sum(one.bytes for one in parts),
            ncccs=max(one.ncccs for one in parts),
            checks=sum(one.checks for one in parts),
            wall_s=max(one.wall_s for one in parts),
            largest=max(one.largest for one in parts),
        ),
        None
        if first.changes is None
        else [
            CycleChange(*map(np.concatenate, zip(*cycle, strict=True)))
            for cycle in zip(*(one.changes or () for one in reports), strict=True)
        ],
    )
