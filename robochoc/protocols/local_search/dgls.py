"""Distributed Guided Local Search (DGLS).

GDBA with three changes. A constraint is violated with a probability that grows with its cost, so expensive constraints
are penalised more often. Penalties evaporate: in each cycle they are multiplied by `gamma`. And penalties are the same
on both sides of a constraint: with its next value, a robot sends its neighbours the constraints that it has penalised.

- **When to use**: costs, a large team, time for many cycles: like GDBA, also if each pair of values has its own cost.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The result is the best
  cycle (anytime); costs rise and fall. A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `modifier` (A or M; default M), `gamma` (from 0 to below 1; default 0.5), `scope` (E, R, C
  or T; default T), `cycles` (default 100). The paper uses a `gamma` of 0.5 on random costs and 0.9 on structured costs.
- **References**: Deng, Wang, An: "GDBA revisited: unleashing the power of guided local search for distributed
  constraint optimization", arXiv 2508.06899, 2025 (AAAI 2026). Only the abstract was available, and a public summary
  that quotes the formulas and theorems; the rules are built from these two.

The rules:

    violated with probability (cost - minimum) / (maximum - minimum)           `_share`, `penalise`
    modifiers M <- gamma M in each cycle, so M <= 1 / (1 - gamma)              `start_cycle`
    one penalty for a constraint that both sides penalise (SYNC)               `start_cycle`
    effective cost: f + M (A), f (1 + M) (M)                                   `effective_costs`
    entries of a penalty: entry, row, column, table (E, R, C, T)               `_pattern`

Choices that the references leave open, and differences:

- SYNC messages are part of the next value message. No robot moves between the two, since a robot penalises only if
  neither it nor a neighbour can reduce its cost.
- A function is the sum of all constraints between the same robots. It may be n-ary; with R or C, robots that penalise
  it in the same cycle count once for the current entry only.
- A broken hard constraint is always violated. Costs are pairs as in `mgm`; M multiplies both parts, A adds a broken
  constraint to a broken one.
- Modifiers are integers, in thousandths, so that all robots compute the same ones.
- First values, equally good values, equal reductions and lost messages are treated as in `mgm`.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), DGLS, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'PenalisedValue': 5600, 'Reduction': 5600}
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple

from robochoc.model.problem import INFINITE
from robochoc.protocols import message as wire
from robochoc.protocols.local_search.gdba import Breakout, Improve, pair, summed
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleSettings, Then, Value
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.encoding import Cost
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.system.plain_text import listed

UNIT = 1000
"""One penalty. Modifiers, effective costs and reductions are in thousandths."""


class DGLSSettings(CycleSettings, frozen=True):
    """The rule by which constraints with high costs are penalised in a quasi-local minimum.

    `modifier`: A adds penalties to the cost, M multiplies it. `gamma`: the share of each penalty that is left after a
    cycle. `scope`: a penalty concerns one entry of the table (E), those of all values of the robot that penalises
    against the others' current ones (R), those of its value against all of theirs (C), or the whole table (T).
    `cycles`: the number of cycles.
    """

    modifier: Literal["A", "M"] = "M"
    gamma: float = 0.5
    scope: Literal["E", "R", "C", "T"] = "T"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.gamma < 1:
            raise ValueError(f"gamma is {self.gamma:g}; it must be from 0 to below 1")


class PenalisedValue(Value, frozen=True):
    """The sender's value, and the functions that it has penalised: for each of them, its robots except the sender."""

    penalised: tuple[tuple[str, ...], ...] = ()

    def in_words(self, words: Wording) -> str:
        said = super().in_words(words)
        functions = listed([f"with {listed(robots)}" for robots in self.penalised])
        return (
            f"{said}; I have penalised our function{'s' * (len(self.penalised) > 1)} {functions}" if functions else said
        )


class Reduction(Improve, frozen=True):
    """The reduction of the sender's effective cost by its best move, in thousandths."""

    def in_words(self, _: Wording) -> str:
        saved = [f"{cost_text(self.broken / UNIT)} of broken constraints"] if self.broken else []
        saved += [f"{cost_text(self.cost / UNIT)} of cost"] if self.cost else []
        return f"with penalties, my move would save {listed(saved) or 'nothing'}"


Pattern = tuple[int | None, tuple[wire.Value | None, ...]]
"""Entries of a function: the index of this robot's value, and the values of the others. None: all values."""


class Function(NamedTuple):
    """The sum of all constraints with the same robots.

    Attributes:
        others: The current values of the other robots.
        costs: The cost of each of this robot's values.
        least: The minimum of the function.
        most: The maximum finite cost.
    """

    others: tuple[wire.Value, ...]
    costs: list[LexicographicCost]
    least: Cost
    most: Cost


class DGLS(Breakout):
    """One agent of DGLS. A cycle has two phases: all robots send their values, then their reductions.

    `functions` are the functions in this cycle, by their other robots in priority order. `modifiers` are their
    penalties, in thousandths.
    """

    messages: ClassVar[Any] = PenalisedValue | Reduction | AnytimeMessage
    settings: ClassVar[DGLSSettings] = DGLSSettings()
    improve = Reduction
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Deng, Wang, An 2025",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        use_when="as GDBA, many cycles: penalties evaporate",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.modifiers: dict[tuple[str, ...], dict[Pattern, int]] = {}
        self.penalised: list[tuple[str, ...]] = []
        """The functions that this robot has penalised in the last cycle."""
        self._robots: list[tuple[str, ...]] = []
        """The other robots of each constraint, by its number."""
        self.functions: dict[tuple[str, ...], Function] = {}
        self._ranges: dict[tuple[str, ...], tuple[Cost, Cost]] = {}

    def start_cycles(self) -> None:
        """Find the functions, and choose a random value."""
        scopes = self.problem.scopes(self.problem.neighbours)
        self._robots = [robots for robots, _ in scopes]
        for number, (robots, most) in enumerate(scopes):
            least, highest = self.problem.least_and_most(number)
            before = self._ranges.get(robots, (0, 0))
            self._ranges[robots] = before[0] + least, before[1] + (most if highest == INFINITE else highest)
        super().start_cycles()

    def exchange_values(self, then: Then) -> None:
        """Send this robot's value and penalties to all neighbours, wait for theirs, then call `then`."""
        value = self.problem.values[self.present]
        for name in self.problem.neighbours:
            penalised = [tuple([one for one in robots if one != name]) for robots in self.penalised if name in robots]
            self.send(name, PenalisedValue(value, tuple(penalised)))
        self.listen(self.problem.neighbours, then)

    def start_cycle(self, view: Mapping[str, wire.Value], messages: Mapping[str, wire.Message]) -> None:
        """Let all penalties evaporate, then add one to each function that any of its robots has penalised."""
        gamma = self.settings.gamma
        for robots, kept in self.modifiers.items():
            self.modifiers[robots] = {key: left for key, paid in kept.items() if (left := int(paid * gamma))}
        by: dict[tuple[str, ...], set[str]] = {robots: {self.problem.agent} for robots in self.penalised}
        for name, message in messages.items():
            if isinstance(message, PenalisedValue):
                for others in message.penalised:
                    by.setdefault(self._function_of(name, others), set()).add(name)
        for robots, penalisers in by.items():
            if all(name in view for name in robots):
                self._add(robots, penalisers, tuple([view[name] for name in robots]))
        self.penalised = []

    def _function_of(self, sender: str, others: Iterable[str]) -> tuple[str, ...]:
        """Return the key of the function of `sender`, this robot and `others`.

        Raises:
            ValueError: if there is none.
        """
        robots = tuple(sorted({sender, *others}, key=lambda name: self.order.rank.get(name, -1)))
        if robots not in self._ranges:
            raise ValueError(f"{sender} has penalised a function that this robot does not share")
        return robots

    def _add(self, robots: tuple[str, ...], penalisers: set[str], others: tuple[wire.Value, ...]) -> None:
        modifiers = self.modifiers.setdefault(robots, {})
        patterns = [self._pattern(name, robots, others) for name in sorted(penalisers)]
        for pattern in patterns if self.settings.scope in "RC" else patterns[:1]:
            modifiers[pattern] = modifiers.get(pattern, 0) + UNIT
        if self.settings.scope in "RC" and len(patterns) > 1:  # the current entry is in all of them
            entry = self.present, others
            modifiers[entry] = modifiers.get(entry, 0) - (len(patterns) - 1) * UNIT

    def _pattern(self, penaliser: str, robots: tuple[str, ...], others: tuple[wire.Value, ...]) -> Pattern:
        """Return the entries that a penalty of the robot called `penaliser` concerns."""
        scope = self.settings.scope

        def fixed(name: str) -> bool:
            return scope == "E" or (scope == "R" and name != penaliser) or (scope == "C" and name == penaliser)

        values = [value if fixed(name) else None for name, value in zip(robots, others, strict=True)]
        return self.present if fixed(self.problem.agent) else None, tuple(values)

    def effective_costs(self) -> list[LexicographicCost]:
        """Return the effective cost of each of this robot's values, in thousandths."""
        self.functions = self._sums()
        alone = [(broken * UNIT, cost * UNIT) for broken, cost in map(pair, self.problem.charges)]
        return summed([alone, *(self._effective(robots, function) for robots, function in self.functions.items())])

    def _sums(self) -> dict[tuple[str, ...], Function]:
        """Return the functions whose other robots' values are known."""
        sums: dict[tuple[str, ...], Function] = {}
        for number, _, _, costs in self.charged:
            robots = self._robots[number]
            row = [pair(cost) for cost in costs]
            if robots in sums:
                row = summed([sums[robots].costs, row])
            sums[robots] = Function(tuple([self._last_values[name] for name in robots]), row, *self._ranges[robots])
        return sums

    def _effective(self, robots: tuple[str, ...], function: Function) -> list[LexicographicCost]:
        """Return the effective cost of each of this robot's values in one function."""
        penalties = self.penalties(robots, function)
        if self.settings.modifier == "M":
            return [
                (broken * (UNIT + penalty), cost * (UNIT + penalty))
                for (broken, cost), penalty in zip(function.costs, penalties, strict=True)
            ]
        return [
            (broken * UNIT + penalty, cost * UNIT) if broken else (0, cost * UNIT + penalty)
            for (broken, cost), penalty in zip(function.costs, penalties, strict=True)
        ]

    def penalties(self, robots: tuple[str, ...], function: Function) -> list[int]:
        """Return the penalty of each of this robot's values in one function."""
        penalties = [0] * len(function.costs)
        for (own, values), penalty in self.modifiers.get(robots, {}).items():
            if all(value in (None, now) for value, now in zip(values, function.others, strict=True)):
                for index in range(len(penalties)) if own is None else (own,):
                    penalties[index] += penalty
        return [max(penalty, 0) for penalty in penalties]  # thousandths are rounded

    def penalise(self) -> None:
        """Penalise each function with a probability that grows with its cost."""
        for robots, function in self.functions.items():
            share = self._share(function)
            if share >= 1 or (share > 0 and self.chance() < share):
                self.penalised.append(robots)

    def _share(self, function: Function) -> float:
        """Return the current cost of a function, from 0 (its minimum) to 1 (its maximum, or broken)."""
        broken, cost = function.costs[self.present]
        if broken:
            return 1
        if cost <= function.least:
            return 0
        return (cost - function.least) / (function.most - function.least)
