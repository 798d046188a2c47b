"""The common base of synchronous protocols as arrays: what `protocols/shared/cycles.py` is for robots that are objects.

One `step` is a cycle of all robots. Each method has the name of what it does for all of them in `protocols`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple, TypeVar, cast

import numpy as np

from robochoc.communication.arrays.chance import Draws
from robochoc.communication.arrays.kinds import FEW, Flags, Floats, Integers
from robochoc.communication.arrays.layout import Group, Layout
from robochoc.communication.arrays.tally import Tally
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.shared.cycles import CycleCount, CycleSettings, Value
from robochoc.solver.encoding import UnsupportedError
from robochoc.solver.exact_costs import EXACT

WITHOUT_ANYTIME = "as arrays, the best cycle is the answer without it"
Costs = TypeVar("Costs", Integers, Floats)


class Change(NamedTuple):
    """The rows whose values have changed in a cycle, and their values."""

    rows: Integers
    values: Integers


class CycleRun(ABC):
    """A run of one protocol on one team.

    Attributes:
        values: The place of each row's value in its domain.
        cycle: The cycle of these values; -1 before the first.
        costs: The cost of the values of each cycle; `inf` where a hard constraint is broken.
        changes: Of each cycle, where they are kept.
        best: The values of the cheapest cycle, the first of several; the last one if all cost `inf`.
        verdict: Set when one robot has proven that there is no solution: `witness`.
        tally: What was sent.
        checks: Constraint checks of all robots.
        clocks: The NCCC clock of each row. None: they are not kept.
    """

    settings: CycleCount

    def __init__(
        self, layout: Layout, settings: CycleCount, seed: int, *, clocks: bool = True, changes: bool = False
    ) -> None:
        if isinstance(settings, CycleSettings) and settings.anytime == "yes":
            raise UnsupportedError(f"anytime=yes is for robots that send messages; {WITHOUT_ANYTIME}")
        self.layout = layout
        self.settings = settings
        self.values: Integers = np.zeros(layout.many, layout.kind)
        self.cycle = -1
        self.costs: list[float] = []
        self.changes: list[Change] | None = [] if changes else None
        self.best: Integers = self.values
        self.verdict: Verdict | None = None
        self.witness: int | None = None
        self.tally = Tally()
        self.checks = 0
        self.clocks: Integers | None = np.zeros(layout.many, np.int64) if clocks else None
        names = layout.description.names
        self.draws = Draws(seed, (names[robot] for robot in layout.robots.tolist()), layout.many)
        self._firsts = [np.arange(group.active) * group.size for group in layout.groups]
        self._active = sum(group.active for group in layout.groups)
        self.all_checks = np.zeros(layout.many, np.int64)
        """What it takes each row with neighbours to evaluate its values; 0 for the others."""
        for group in layout.groups:
            self.all_checks[group.first : group.first + group.active] = group.checks[: group.active]

    @property
    def over(self) -> bool:
        """Whether no cycle is left."""
        return self.verdict is not None or self.cycle >= self.settings.cycles or not self._active

    def begin(self) -> None:
        """Let all robots start: cycle 0."""
        for group in self.layout.groups:
            self._settle_alone(group)
        if self._active:
            self._begin()
        self.cycle = 0
        if self.layout.empty.size:
            self.verdict, self.witness = Verdict.NO_SOLUTION, int(self.layout.empty[-1])
        if self.changes is not None:
            self.changes.append(Change(np.arange(self.layout.many), self.values.copy()))

    def step(self) -> None:
        """Go through one cycle."""
        before = self.values.copy()
        self._step()
        if self.verdict is not None:
            return
        self.cycle += 1
        if self.changes is not None:
            rows = np.flatnonzero(before != self.values)
            self.changes.append(Change(rows, self.values[rows]))

    def end(self) -> None:
        """Weigh the values of the last cycle."""
        if self.layout.empty.size or len(self.costs) > self.cycle:
            return
        self._weigh()

    def metrics(self, wall_s: float) -> Metrics:
        """Return what the run has taken so far, `wall_s` seconds."""
        return Metrics(
            messages=dict(sorted(self.tally.messages.items())),
            bytes=self.tally.bytes,
            ncccs=0 if self.clocks is None else int(self.clocks.max(initial=0)),
            checks=self.checks,
            wall_s=wall_s,
            largest=self.tally.largest,
        )

    @abstractmethod
    def _begin(self) -> None:
        """Give robots with neighbours their first values, and let them speak."""

    @abstractmethod
    def _step(self) -> None:
        """Weigh the present values, and take those of the next cycle."""

    @abstractmethod
    def _weigh(self) -> None:
        """Weigh the present values."""

    # Values

    def take_any(self) -> None:
        """Take a random value of the whole domain."""
        for group in self.layout.groups:
            rows = np.arange(group.first, group.first + group.active)
            chosen = self.draws.any_of(rows, np.full(group.active, group.size))
            self.values[rows] = chosen.astype(self.layout.kind)

    def burdens(self) -> list[Integers]:
        """Return the cost of each value of the robots with neighbours, by group, and weigh the present values."""
        found, sums = [], _Sums()
        for group, firsts in zip(self.layout.groups, self._firsts, strict=True):
            own = group.values(self.values)
            total = _fixed(group)
            chosen = total.ravel().take(firsts + own[: group.active])
            sums.add(self.layout, chosen, 1)
            if group.fixed is not None and group.active < group.many:
                alone = np.arange(group.active, group.many)
                sums.add(self.layout, group.fixed[alone, own[alone]], 1)
            for block in group.blocks:
                for column in block.columns:
                    total[column.lists] += block.rows.take(column.rows(self.values), axis=0)
                now = total.ravel().take(firsts + own[: group.active])
                sums.add(self.layout, now - chosen, block.held.others.shape[1] + 1)
                chosen = now
            found.append(total)
        self.note(sums.cost)
        return found

    def note(self, cost: float) -> None:
        """Note the cost of the present values."""
        if not self.costs or cost < min(self.costs) or cost == INFINITE == min(self.costs):
            self.best = self.values.copy()
        self.costs.append(cost)

    def present(self, number: int, burdens: Integers) -> Integers:
        """Return what the present values of the group of this `number` cost, of the robots with neighbours."""
        group = self.layout.groups[number]
        chosen: Integers = burdens.ravel().take(self._firsts[number] + group.values(self.values)[: group.active])
        return chosen

    # Messages, checks and clocks

    def tell_values(self) -> None:
        """Let robots tell all neighbours their values."""
        lengths = self.layout.description.value_bytes
        if isinstance(lengths, np.ndarray):
            lengths = lengths[self._first_entries + self.values]
        self.tally.add(Value.__name__, lengths, self.layout.degrees)

    def count_checks(self, checks: Integers, times: int = 1) -> None:
        """Count `checks` of each row, made by all of them at once."""
        self.checks += times * int(checks.sum())
        if self.clocks is not None:
            self.clocks += times * checks

    def hear(self) -> None:
        """Take in a message of each neighbour: clocks rise to theirs."""
        if self.clocks is not None:
            self.clocks = self.greatest(self.clocks, self.clocks.copy())

    def greatest(self, told: Integers, heard: Integers) -> Integers:
        """Raise `heard` to the greatest that the neighbours of each row have `told`, and return it."""
        for group, lists, neighbours, _ in self.layout.links:
            part = heard[group.first : group.last]
            if isinstance(lists, slice):
                np.maximum(part[lists], told.take(neighbours), out=part[lists])
            else:
                part[lists] = np.maximum(part[lists], told.take(neighbours))
        return heard

    def _settle_alone(self, group: Group) -> None:
        """Let robots without neighbours take their cheapest values."""
        alone = slice(group.first + group.active, group.last)
        if group.fixed is not None:
            self.values[alone] = group.fixed[group.active :].argmin(axis=1).astype(self.layout.kind)
        checks = group.checks[group.active :]
        self.checks += int(checks.sum())
        if self.clocks is not None:
            self.clocks[alone] = checks

    @cached_property
    def _first_entries(self) -> Integers:
        sizes = self.layout.description.sizes
        return (np.cumsum(sizes) - sizes)[self.layout.robots]


class _Sums:
    """A sum of costs, each of which several robots have counted."""

    def __init__(self) -> None:
        self._broken: dict[int, int] = {}
        self._paid: dict[int, int] = {}

    def add(self, layout: Layout, costs: Integers, times: int) -> None:
        """Add `costs`, which `times` robots count."""
        broken = int(layout.costs.broken(costs).sum())
        self._broken[times] = self._broken.get(times, 0) + broken
        self._paid[times] = self._paid.get(times, 0) + layout.costs.sum(costs) - (broken << layout.costs.bits)

    @property
    def cost(self) -> float:
        """The sum."""
        if any(self._broken.values()):
            return INFINITE
        return sum(paid // times for times, paid in self._paid.items())


def _fixed(group: Group) -> Integers:
    """Return a copy of what values cost whatever others do, for the robots with neighbours."""
    if group.fixed is not None:
        return group.fixed[: group.active].copy()
    kind = group.blocks[0].rows.dtype if group.blocks else np.dtype(np.int32)
    return np.zeros((group.active, group.size), kind)


def exact_sum(costs: Floats) -> float:
    """Return the sum of `costs`, whole numbers or `inf`: an integer where floats do not hold it exactly."""
    total = float(costs.sum())
    return total if total < EXACT or total == INFINITE else sum(map(int, costs.ravel().tolist()))


def least(costs: Costs) -> Costs:
    """Return the least of each row."""
    if costs.shape[1] > FEW:
        return cast("Costs", costs.min(axis=1))
    found = costs[:, 0].copy()
    for place in range(1, costs.shape[1]):
        np.minimum(found, costs[:, place], out=found)
    return found


def count(flags: Flags) -> Integers:
    """Return how many flags of each row are set."""
    if flags.shape[1] > FEW:
        many: Integers = flags.sum(axis=1)
        return many
    many = flags[:, 0].astype(np.int64)
    for place in range(1, flags.shape[1]):
        many += flags[:, place]
    return many


def nth(flags: Flags, numbers: Integers) -> Integers:
    """Return, for each row, the place of the flag of this number (from 0) among those that are set."""
    found: Integers = (flags.cumsum(axis=1) > numbers[:, None]).argmax(axis=1)
    return found


def walk(run: CycleRun) -> Iterator[CycleRun]:
    """Yield `run` before it begins its next cycle, and once more when it is over."""
    run.begin()
    yield run
    while not run.over:
        run.step()
        yield run
    run.end()
