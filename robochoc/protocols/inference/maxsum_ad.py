"""Max-Sum with alternating directions (Max-Sum_AD, ADVP, ADSSVP).

Max-Sum on a graph whose edges all have one direction for a phase, and the other one in the next. A phase's graph has no
cycles, so its messages settle. From the third phase on, robots may also tell their values instead of what each value
would cost (value propagation): then the others answer a value that is really taken, and the search settles for good.

- **When to use**: costs, and a graph with many cycles, on which Max-Sum does not settle.
- **Guarantees**: incomplete; it stops after `cycles` phases. AD is optimal on a graph without cycles after one phase
  more than the longest path has turns between higher and lower robots: two phases in a tree's order (`--order dfs`).
  ADVP settles, where constraints are between two robots: from phase 4 on the cost never rises, and in the end no robot
  alone can do better. The result is the best phase (anytime). A robot all of whose values cost `inf` before values have
  been told proves that there is no solution.
- **Parameters (`--set`)**: `variant` (`AD`; `ADVP`, value propagation from phase 3 on; `ADSSVP`, the same, but not in
  every third phase; default `ADSSVP`), `preference` (the maximum random charge of a value; default 0.01), `cycles` (the
  number of phases; default 100).
- **References**: Zivan, Parash, Cohen, Peled, Okamoto: "Balancing exploration and exploitation in incomplete
  Min/Max-sum inference for distributed constraint optimization", JAAMAS 31(5), 2017; for ADSSVP: Chen, Deng, Wu: "An
  iterative refined Max-sum_AD algorithm via single-side value propagation and local search", AAMAS 2017.

The nodes are those of Max-Sum (`maxsum`); a function stands just before the robot that holds it, the lowest of its
scope. In odd phases messages go up: robots tell R, from a function to the robots above. In even phases they go down:
robots tell Q to the functions of those below. The last messages of the other direction are kept, and count.

Choices that the papers leave open, and differences:

- In the paper a phase takes as many rounds as the longest path has nodes, and each round has a message on each edge.
  Here a robot waits for all that are above it (or below), and tells its messages once. That is what the rounds end
  with, at one message for each pair of neighbours and phase.
- The first phase goes up, as only holders know how many functions there are.
- A value is told as a Q that rules out all other values, so one rule makes R from both.
- Where all values cost `inf` by told values, a robot takes the one that violates the fewest functions. Its Q then says
  nothing.
- With constraints of three or more robots, a robot may answer values of the phase before. Then ADVP need not settle.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), MaxSumAD, Concurrent(seed=0)).search()
>>> result.verdict.value, result.metrics.messages
('no-solution', {'Domain': 6, 'R': 3})
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from robochoc.model import message as wire
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.inference.maxsum_factor import Factor, Row, cheapest, from_zero, total, without_each
from robochoc.protocols.inference.messages.maxsum import Q, R
from robochoc.protocols.inference.settings.maxsum_ad import MaxSumADSettings
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.cycles import CycleProtocol
from robochoc.protocols.shared.messages.cycles import Domain, Value
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.compiled import LocalProblem

FIRST_WITH_VALUES = 3
"""The phase from which on values may be told: both directions have been gone."""
PERIOD = 3
"""ADSSVP tells no values in every third phase."""


class MaxSumAD(CycleProtocol):
    """One agent of Max-Sum_AD. A cycle is a phase.

    `factors` are the own functions. Kept are the last messages: `from_above` (Q, for each robot a row for each own
    function with it), `from_below` (R), and the answers of the own functions, `own`.
    """

    messages = Domain | R | Q | Value
    settings: ClassVar[MaxSumADSettings] = MaxSumADSettings()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Zivan, Parash, Cohen, Peled, Okamoto 2017",
        complete=False,
        costs=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="costs, graph with many cycles; no proof",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        place = order.rank[problem.agent]
        self.above = tuple(name for name in problem.neighbours if order.rank[name] < place)
        self.below = tuple(name for name in problem.neighbours if order.rank[name] > place)
        self.factors: list[Factor] = []
        self.preferred: Row = []
        self.from_above: dict[str, list[Row]] = {}
        self.from_below: dict[str, list[Row]] = {}
        self.own: list[Row] = []
        self._domains: dict[str, list[wire.Value]] = {}

    def begin(self) -> None:
        """Take the value with the lowest own charge, and send the domain to the holders of the own functions."""
        preference = self.settings.preference
        self.preferred = [cost + preference * self.chance() for cost in self.problem.costs({})]
        self.take(cheapest(self.preferred))
        self.tell(self.below, Domain(list(self.problem.values)))
        self.listen(self.above, self._build)

    def _build(self, messages: Mapping[str, wire.Message]) -> None:
        """Make the own functions from the received domains. All messages are 0 before there are any."""
        self._domains = {name: list(told.values) for name, told in messages.items() if isinstance(told, Domain)}
        self.factors = Factor.joined(self.problem.tables(self._domains))
        self.own = [[0.0] * len(self.preferred) for _ in self.factors]
        for name, values in self._domains.items():
            self.from_above[name] = [[0.0] * len(values) for factor in self.factors if name in factor.agents]
        self.listen(self.below, self._up)

    # Phases

    def _up(self, messages: Mapping[str, wire.Message]) -> None:
        """Hear R from below, take a value, and send R to the robots above."""
        for name, message in messages.items():
            if isinstance(message, R):
                self.from_below[name] = self._checked(message.rows, len(self.preferred), self.from_below.get(name))
        if not self._choose():
            return
        answers = [self._answers(place, mine)[:-1] for place, mine in enumerate(self._q()[: len(self.factors)])]
        said: dict[str, list[Row]] = {name: [] for name in self.above}
        for factor, rows in zip(self.factors, answers, strict=True):
            for name, row in zip(factor.agents, rows, strict=True):
                said[name].append(row)
        for name, rows in said.items():
            self.send(name, R(rows))
        if not self.over:
            self.listen(self.above, self._down)

    def _down(self, messages: Mapping[str, wire.Message]) -> None:
        """Hear Q or values from above, take a value, and send Q or the value to the robots below."""
        for name, message in messages.items():
            self._hear(name, message)
        nothing = [0.0] * len(self.preferred)
        self.own = [self._answers(place, nothing)[-1] for place in range(len(self.factors))]
        if not self._choose():
            return
        if self._tells_values:
            self.tell(self.below, Value(self.problem.values[self.present]))
        else:
            rows = iter(self._q()[len(self.factors) :])
            for name, heard in self.from_below.items():
                self.send(name, Q([next(rows) for _ in heard]))
        if not self.over:
            self.listen(self.below, self._up)

    @property
    def _tells_values(self) -> bool:
        """Whether values are told in this phase (value propagation)."""
        phase, variant = self.cycle, self.settings.variant
        if variant == "AD" or phase < FIRST_WITH_VALUES:
            return False
        return variant == "ADVP" or (phase - FIRST_WITH_VALUES) % PERIOD < PERIOD - 1

    def _hear(self, name: str, message: wire.Message) -> None:
        """Keep what a robot above has told. A value rules out all others."""
        values, before = self._domains[name], self.from_above[name]
        if isinstance(message, Value):
            taken = values.index(message.value)
            row = [INFINITE] * len(values)
            row[taken] = 0.0
            self.from_above[name] = [row] * len(before)
        elif isinstance(message, Q):
            self.from_above[name] = self._checked(message.rows, len(values), before)

    def _checked(self, rows: list[Row], size: int, before: Sequence[Row] | None) -> list[Row]:
        """Return `rows`; `ValueError` if they are not as many as `before`, or not of `size` entries."""
        if (before is not None and len(rows) != len(before)) or any(len(row) != size for row in rows):
            raise ValueError(f"the message has not the rows that {self.problem.agent} shares functions for")
        return rows

    # Equations

    def _answers(self, place: int, mine: Row) -> list[Row]:
        """Return R of the own function at `place` to each of its robots, if `mine` is the own Q."""
        factor = self.factors[place]
        told = []
        for name in factor.agents:
            shared = [number for number, other in enumerate(self.factors) if name in other.agents]
            told.append(self.from_above[name][shared.index(place)])
        return factor.r([*told, mine])

    @property
    def _rows(self) -> list[Row]:
        """All R: of the own functions, then of those of each robot below."""
        return [*self.own, *(row for rows in self.from_below.values() for row in rows)]

    def _choose(self) -> bool:
        """Take the cheapest value. Return False if that has proven that there is no solution."""
        rows = self._rows
        z = total(self.preferred, rows)
        if min(z) < INFINITE:
            self.take(cheapest(z))
            return True
        if self.settings.variant == "AD" or self.cycle + 1 < FIRST_WITH_VALUES:
            self.conclude(Verdict.NO_SOLUTION)
            return False
        columns = list(zip(self.preferred, *rows, strict=True))
        burdens = [(column.count(INFINITE), sum(cost for cost in column if cost < INFINITE)) for column in columns]
        self.take(burdens.index(min(burdens)))
        return True

    def _q(self) -> list[Row]:
        """Return Q to each function: the cost of each value by all others; or the value alone, when it is told."""
        rows = self._rows
        if self._tells_values:
            alone = [INFINITE] * len(self.preferred)
            alone[self.present] = 0.0
            return [alone] * len(rows)
        fresh = without_each(self.preferred, rows, total(self.preferred, rows))
        return [from_zero(row) if min(row) < INFINITE else [0.0] * len(row) for row in fresh]
