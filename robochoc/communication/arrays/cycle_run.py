"""The common base of synchronous protocols on arrays, like `protocols/shared/cycles.py` for robots as objects.

One `step` is a cycle of all robots. Comments name the corresponding methods in `protocols`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import ClassVar, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from robochoc.communication.arrays import compiled
from robochoc.communication.arrays.array_types import FEW, Flags, Floats, Index, Integers, Places
from robochoc.communication.arrays.border import WHOLE_TEAM, Border
from robochoc.communication.arrays.kernels import LARGEST_VALUE_SIZE, CycleAccount, Kernels
from robochoc.communication.arrays.layout import ArrayLayout, RobotGroup
from robochoc.communication.arrays.tally import MessageTally
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.chance import FIRST_FACTOR, SECOND_FACTOR, UNIT
from robochoc.protocols.shared.cycles import CycleCount, CycleSettings, Value
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.exact_costs import EXACT

WITHOUT_ANYTIME = "remove it, as arrays always return the best cycle"
_FIRST, _SECOND = np.uint64(FIRST_FACTOR), np.uint64(SECOND_FACTOR)
_FLOAT_BITS = np.uint64(11)
Costs = TypeVar("Costs", Integers, Floats)


class CycleChange(NamedTuple):
    """The rows whose values changed in a cycle, and the new values."""

    rows: Integers
    values: Integers


class Draws:
    """The random numbers of all robots, equal to those in `protocols/chance.py`: two words per robot."""

    def __init__(self, seed: int, names: Iterable[str], many: int) -> None:
        self.states, self.steps = compiled.keys_and_steps(seed, names, many)

    def draw(self, robots: Index) -> NDArray[np.float64]:
        """Return the next random number of each robot in `robots`, which must not contain duplicates."""
        bits = self.states[robots] + self.steps[robots]
        self.states[robots] = bits
        mixed = (bits ^ bits >> np.uint64(30)) * _FIRST
        mixed = (mixed ^ mixed >> np.uint64(27)) * _SECOND
        mixed ^= mixed >> np.uint64(31)
        return (mixed >> _FLOAT_BITS).astype(np.float64) * UNIT

    def choose(self, robots: Places, many: Integers) -> Integers:
        """Return, for each of `robots`, a random number below `many`. If there is only one choice, nothing is drawn."""
        chosen = np.zeros(len(robots), np.int64)
        several = np.flatnonzero(many > 1)
        chosen[several] = (self.draw(robots[several]) * many[several]).astype(np.int64)
        return chosen


class CycleRun(ABC):
    """A run of one protocol on one team.

    Attributes:
        values: The index of each row's value in its domain.
        cycle: The number of the current cycle; -1 before the start.
        costs: The cost of the values in each cycle; `inf` if a hard constraint is violated.
        changes: The changed values in each cycle; None if they are not recorded.
        best: The values in the first of the cheapest cycles; in the last cycle if all cycles cost `inf`.
        verdict: Set when the robot `witness` has proven that there is no solution.
        tally: The counts of sent messages.
        checks: The constraint checks of all robots together.
        border: The connection to the robots in other processes.
        starts: See `Description.starts`.
    """

    settings: CycleCount
    clocks_depend_on_values: ClassVar[bool] = True
    """False if each robot makes equal checks in each cycle: clocks of a block then follow from its own robots."""
    in_blocks: ClassVar[bool] = False
    """True if a team can run in several blocks (`blocks.py`)."""
    functions_in_blocks: ClassVar[bool] = False
    """True if a block needs functions that robots in other blocks hold."""

    def __init__(
        self, layout: ArrayLayout, settings: CycleCount, seed: int, *, clocks: bool = True, changes: bool = False
    ) -> None:
        if isinstance(settings, CycleSettings) and settings.anytime == "yes":
            raise UnsupportedError(f"anytime=yes cannot be used with --runtime arrays: {WITHOUT_ANYTIME}")
        self.layout = layout
        self.settings = settings
        self.values: Integers = np.zeros(layout.many, layout.kind)
        self.cycle = -1
        self.costs: list[float] = []
        self._lowest: float = INFINITE
        self.changes: list[CycleChange] | None = [] if changes else None
        self.best: Integers = self.values
        self.verdict: Verdict | None = None
        self.witness: int | None = None
        self.tally = MessageTally()
        self.checks = 0
        self._clocks: Integers | None = np.zeros(layout.many, np.int64) if clocks else None
        self._late_clocks: list[Integers | None] = []
        """For each message from all neighbours that `clocks` do not include, the checks after that message."""
        self._started_clocks = False
        self.border: Border = WHOLE_TEAM
        self.starts = layout.description.starts
        names = layout.description.names
        self.draws = Draws(seed, (names[robot] for robot in layout.robots.tolist()), layout.many)
        self._firsts = [np.arange(group.active) * group.size for group in layout.groups]
        self._active = sum(group.active for group in layout.groups)
        self.all_checks = np.zeros(layout.many, np.int64)
        """The constraint checks that each row needs to evaluate its values; 0 for rows without neighbours."""
        for group in layout.groups:
            self.all_checks[group.first : group.first + group.active] = group.checks[: group.active]

    @property
    def is_over(self) -> bool:
        """True if the run has ended."""
        return (
            self.verdict is not None or self.cycle >= self.settings.cycles or not (self._active or self.border.active)
        )

    def start(self) -> None:
        """Start all robots: cycle 0."""
        for group in self.layout.groups:
            self._settle_alone(group)
        if self._active or self.border.active:
            self._start_active()
        self.cycle = 0
        if self.layout.empty.size:
            self.verdict, self.witness = Verdict.NO_SOLUTION, int(self.layout.empty[-1])
        if self.changes is not None:
            self.changes.append(CycleChange(np.arange(self.layout.many), self.values.copy()))

    def step(self) -> None:
        """Run one cycle."""
        self.border.exchange(self.values, self.clocks if self.clocks_depend_on_values else None)
        before = None if self.changes is None else self.values.copy()
        self._step()
        if self.verdict is not None:
            return
        self.cycle += 1
        if self.changes is not None:
            rows = np.flatnonzero(before != self.values)
            self.changes.append(CycleChange(rows, self.values[rows]))

    def end(self) -> None:
        """Compute the cost of the last cycle's values."""
        if self.layout.empty.size or len(self.costs) > self.cycle:
            return
        self.border.exchange(self.values)
        self._weigh()

    def metrics(self, wall_s: float) -> Metrics:
        """Return the metrics of the run so far, which has taken `wall_s` seconds."""
        return Metrics(
            messages=dict(sorted(self.tally.messages.items())),
            bytes=self.tally.bytes,
            ncccs=self._ncccs(),
            checks=self.checks,
            wall_s=wall_s,
            largest=self.tally.largest,
        )

    @abstractmethod
    def _start_active(self) -> None:
        """Set the first values of robots with neighbours, and send their first messages."""

    @abstractmethod
    def _step(self) -> None:
        """Compute the cost of the current values, and choose the values of the next cycle."""

    @abstractmethod
    def _weigh(self) -> None:
        """Compute the cost of the current values."""

    # Values

    def choose_first_values(self) -> None:
        """Choose the start value, or a random value, for each robot with neighbours."""
        starts = self.starts
        for group in self.layout.groups:
            rows = np.arange(group.first, group.first + group.active)
            if starts is not None:
                known = starts[self.layout.robots[rows]]
                self.values[rows] = known.astype(self.layout.kind)
                rows = rows[known < 0]
            chosen = self.draws.choose(rows, np.full(len(rows), group.size))
            self.values[rows] = chosen.astype(self.layout.kind)

    def value_costs(self) -> list[Integers]:
        """Return the cost of each value of robots with neighbours, by group. Record the cost of the current values."""
        if self.kernels is not None:
            totals, account = self.kernels.value_costs(self.values)
            self.note_account(account)
            return totals
        found, sums = [], self._settled_sums()
        for group, firsts in zip(self.layout.groups, self._firsts, strict=True):
            own = group.values(self.values)
            total = _fixed(group)
            chosen = total.ravel().take(firsts + own[: group.active])
            sums.add(self.layout, chosen, 1)
            for block in group.blocks:
                for column in block.columns:
                    total[column.lists] += block.rows.take(column.rows(self.values), axis=0)
                now = total.ravel().take(firsts + own[: group.active])
                sums.add(self.layout, now - chosen, block.held.others.shape[1] + 1)
                chosen = now
            found.append(total)
        self.note(sums.cost(self.border))
        return found

    def note(self, cost: float) -> None:
        """Record the cost of the current values."""
        if cost < self._lowest or cost == INFINITE == self._lowest:
            self.best, self._lowest = self.values.copy(), cost
        self.costs.append(cost)

    def note_account(self, account: CycleAccount) -> None:
        """Record the cost of the current values, as computed by compiled functions."""
        sums = self._settled_sums()
        for times, (broken, paid) in enumerate(account.sums, start=1):
            sums.add_sum(broken, paid, times)
        self.note(sums.cost(self.border))

    def _settled_sums(self) -> _Sums:
        """Return the cost of the values of robots without neighbours."""
        sums = _Sums()
        for group in self.layout.groups:
            if group.fixed is not None and group.active < group.many:
                alone = np.arange(group.active, group.many)
                sums.add(self.layout, group.fixed[alone, group.values(self.values)[alone]], 1)
        return sums

    @cached_property
    def kernels(self) -> Kernels | None:
        """The compiled functions. None: numpy computes the cycles."""
        functions = compiled.compiled_functions()
        if functions is None or self.layout.index != np.int32 or self.layout.kind.itemsize > LARGEST_VALUE_SIZE:
            return None
        return Kernels(functions, self.layout, self.draws.states, self.draws.steps)

    def present(self, number: int, value_costs: Integers) -> Integers:
        """Return the costs of the current values of robots with neighbours in the group `number`."""
        group = self.layout.groups[number]
        chosen: Integers = value_costs.ravel().take(self._firsts[number] + group.values(self.values)[: group.active])
        return chosen

    # Messages, checks and clocks

    def send_values(self) -> None:
        """Send the values of all robots to their neighbours."""
        lengths = self._value_bytes
        if isinstance(lengths, np.ndarray):
            self.tally.add(Value.__name__, lengths[self._first_entries + self.values], self.layout.degrees)
        else:
            self.tally.add(Value.__name__, lengths, self.links)

    def receive_values(self) -> None:
        """Receive a message from each neighbour, and count the checks for the costs of all values."""
        self.checks += self._checks_of_cycle
        self._late_clocks.append(self.all_checks)

    def count_checks(self, checks: Integers, times: int = 1) -> None:
        """Count `checks` constraint checks for each row. They are made at the same time."""
        self.checks += times * int(checks.sum())
        if self.clocks is not None:
            self.clocks += times * checks

    def receive(self) -> None:
        """Receive a message from each neighbour: advance each clock to the neighbours' clocks."""
        self._late_clocks.append(None)

    @property
    def clocks(self) -> Integers | None:
        """The NCCC clock of each row; None if clocks are not computed. They are computed on demand."""
        late, self._late_clocks = self._late_clocks, []
        if self._clocks is not None and late:
            self._started_clocks = True
            for checks in late:
                self._clocks = self.greatest(self._clocks, self._clocks.copy())
                self._clocks += 0 if checks is None else checks
        return self._clocks

    @clocks.setter
    def clocks(self, clocks: Integers) -> None:
        self._clocks = clocks

    def _ncccs(self) -> int:
        """Return the largest clock.

        If all clocks have only been advanced by `receive` and `receive_values` from 0 on, the largest clock is that of
        the robots with the most checks, so no clocks need to be computed.
        """
        if self._clocks is None:
            return 0
        if self._started_clocks or not self._late_clocks:
            clocks = self.clocks
            return 0 if clocks is None else int(clocks.max(initial=0))
        times = sum(checks is not None for checks in self._late_clocks)
        return max(int(self._clocks.max(initial=0)), times * int(self.all_checks.max(initial=0)))

    def greatest(self, numbers: Integers, largest: Integers) -> Integers:
        """Raise `largest` in each row to the largest of its neighbours' `numbers`, and return it."""
        for group, lists, neighbours, _ in self.layout.links:
            part = largest[group.first : group.last]
            if isinstance(lists, slice):
                np.maximum(part[lists], numbers.take(neighbours), out=part[lists])
            else:
                part[lists] = np.maximum(part[lists], numbers.take(neighbours))
        return largest

    def _settle_alone(self, group: RobotGroup) -> None:
        """Set robots without neighbours to their cheapest values."""
        alone = slice(group.first + group.active, group.last)
        if group.fixed is not None:
            self.values[alone] = group.fixed[group.active :].argmin(axis=1).astype(self.layout.kind)
        checks = group.checks[group.active :]
        self.checks += int(checks.sum())
        if self.clocks is not None:
            self.clocks[alone] = checks

    @cached_property
    def links(self) -> int:
        """The number of pairs of a robot and a neighbour, which is the number of messages if each robot sends one."""
        return int(self.layout.degrees.sum())

    @cached_property
    def _checks_of_cycle(self) -> int:
        return int(self.all_checks.sum())

    @cached_property
    def _value_bytes(self) -> Integers | int:
        """The size of the message with each value. A single number if all are equal."""
        lengths = self.layout.description.value_bytes
        if isinstance(lengths, np.ndarray) and lengths.size and lengths.min() == lengths.max():
            return int(lengths[0])
        return lengths

    @cached_property
    def _first_entries(self) -> Integers:
        sizes = self.layout.description.sizes
        return (np.cumsum(sizes) - sizes)[self.layout.robots]


class _Sums:
    """A sum of costs in which several robots count each cost."""

    def __init__(self) -> None:
        self._broken: dict[int, int] = {}
        self._paid: dict[int, int] = {}

    def add(self, layout: ArrayLayout, costs: Integers, times: int) -> None:
        """Add `costs`, each of which is counted by `times` robots."""
        broken = int(layout.costs.broken(costs).sum())
        self.add_sum(broken, layout.costs.sum(costs) - (broken << layout.costs.bits), times)

    def add_sum(self, broken: int, paid: int, times: int) -> None:
        """Add the number of violated constraints and the other costs, each of which is counted by `times` robots."""
        self._broken[times] = self._broken.get(times, 0) + broken
        self._paid[times] = self._paid.get(times, 0) + paid

    def cost(self, border: Border) -> float:
        """Return the resulting sum, including the robots beyond the border."""
        total: Counter[int] = Counter()
        for broken, paid in border.gather((any(self._broken.values()), list(self._paid.items()))):
            if broken:
                return INFINITE
            for times, part in paid:
                total[times] += part
        return sum(paid // times for times, paid in total.items())


def _fixed(group: RobotGroup) -> Integers:
    """Return a copy of the fixed costs of the values, for robots with neighbours."""
    if group.fixed is not None:
        return group.fixed[: group.active].copy()
    kind = group.blocks[0].rows.dtype if group.blocks else np.dtype(np.int32)
    return np.zeros((group.active, group.size), kind)


def exact_sum(costs: Floats) -> float:
    """Return the sum of `costs`, whole numbers or `inf`. It is an integer if a float would not be exact."""
    total = float(costs.sum())
    return total if total < EXACT or total == INFINITE else sum(map(int, costs.ravel().tolist()))


def least(costs: Costs) -> Costs:
    """Return the minimum of each row."""
    if costs.shape[1] > FEW:
        return cast("Costs", costs.min(axis=1))
    found = costs[:, 0].copy()
    for place in range(1, costs.shape[1]):
        np.minimum(found, costs[:, place], out=found)
    return found


def count(flags: Flags) -> Integers:
    """Return the number of set flags in each row."""
    if flags.shape[1] > FEW:
        many: Integers = flags.sum(axis=1)
        return many
    many = flags[:, 0].astype(np.int64)
    for place in range(1, flags.shape[1]):
        many += flags[:, place]
    return many


def nth(flags: Flags, numbers: Integers) -> Integers:
    """Return, for each row, the index of the set flag with this number (counted from 0)."""
    found: Integers = (flags.cumsum(axis=1) > numbers[:, None]).argmax(axis=1)
    return found


def cycles_of(run: CycleRun) -> Iterator[CycleRun]:
    """Run all cycles. Yield `run` before each next cycle, and once more at the end."""
    run.start()
    yield run
    while not run.is_over:
        run.step()
        yield run
    run.end()
