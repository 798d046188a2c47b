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
- Where messages are lost, the last R and Q stand. A robot that has no R yet from one below tells its domain again, and
  a function whose robots are not all known yet is left out; its holder asks for the domain. The cost may rise then.
- With constraints of three or more robots, a robot may answer values of the phase before. Then ADVP need not settle.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), MaxSumAD, Concurrent(seed=0)).search()
>>> result.verdict.value, result.metrics.messages
('no-solution', {'Domain': 6, 'R': 3})
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols import message as wire
from robochoc.protocols.inference.maxsum import Q, R
from robochoc.protocols.inference.maxsum_factor import Functions, Row, cheapest, checked, from_zero, total, without_each
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleProtocol, CycleSettings, Domain, Value
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem


class MaxSumADSettings(CycleSettings, frozen=True):
    """`variant`: AD, ADVP or ADSSVP. `preference`: the maximum for a value. `cycles`: the number of phases."""

    variant: Literal["AD", "ADVP", "ADSSVP"] = "ADSSVP"
    preference: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.preference < INFINITE:
            raise ValueError(f"preference is {self.preference:g}; it must be a number, 0 or more")


FIRST_WITH_VALUES = 3
"""The phase from which on values may be told: both directions have been gone."""
PERIOD = 3
"""ADSSVP tells no values in every third phase."""


class MaxSumAD(CycleProtocol):
    """One agent of Max-Sum_AD. A cycle is a phase.

    `functions` are the own ones, with the last Q from above. `from_below` holds the last R from each robot below, `own`
    those of the own functions.
    """

    messages = Domain | R | Q | Value | AnytimeMessage
    settings: ClassVar[MaxSumADSettings] = MaxSumADSettings()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Zivan, Parash, Cohen, Peled, Okamoto 2017",
        complete=False,
        costs=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        use_when="costs, graph with many cycles; no proof",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        place = order.rank[problem.agent]
        self.above = tuple(name for name in problem.neighbours if order.rank[name] < place)
        self.below = tuple(name for name in problem.neighbours if order.rank[name] > place)
        self.functions = Functions([], {})
        self.preferred: Row = []
        self.from_below: dict[str, list[Row]] = {}
        self.own: list[Row] = []
        self._nothing: list[Row] = []
        self._domains: dict[str, list[wire.Value]] = {}

    def start_cycles(self) -> None:
        """Take the value with the lowest own charge, and send the domain to the holders of the own functions."""
        preference = self.settings.preference
        self.preferred = [cost + preference * self.chance() for cost in self.problem.costs({})]
        self.choose(cheapest(self.preferred))
        self.multicast(self.below, Domain(list(self.problem.values)))
        self.listen(self.above, self._build)

    def _build(self, messages: Mapping[str, wire.Message]) -> None:
        """Make the own functions from the received domains."""
        self._domains = self.checked_domains(messages)
        self._make_functions()
        self.listen(self.below, self._up)

    def _make_functions(self) -> None:
        """Make the functions of robots whose domains are known."""
        self.functions = Functions(self.problem.tables(self._domains), self._domains)
        self._nothing = [[0.0] * len(self.preferred) for _ in self.functions.factors]
        self.own = self._nothing

    # Phases

    def _up(self, messages: Mapping[str, wire.Message]) -> None:
        """Hear R from below, take a value, and send R to the robots above."""
        for name, message in messages.items():
            self._hear(name, message)
        if not self._choose():
            return
        _, said = self.functions.answers(self._q()[: len(self._nothing)])
        for name in self.above:
            self.send(name, R(said[name]) if name in said else Domain(list(self.problem.values)))
        if not self.finished:
            self.listen(self.above, self._down)

    def _down(self, messages: Mapping[str, wire.Message]) -> None:
        """Hear Q or values from above, take a value, and send Q or the value to the robots below."""
        for name, message in messages.items():
            self._hear(name, message)
        self.own, _ = self.functions.answers(self._nothing)
        if not self._choose():
            return
        rows = iter(self._q()[len(self._nothing) :])
        told: dict[str, Q | Value]
        if self._tells_values:
            told = dict.fromkeys(self.from_below, Value(self.problem.values[self.present]))
        else:
            told = {name: Q([next(rows) for _ in heard]) for name, heard in self.from_below.items()}
        for name in self.below:
            self.send(name, told.get(name) or Domain(list(self.problem.values)))
        if not self.finished:
            self.listen(self.below, self._up)

    @property
    def _tells_values(self) -> bool:
        """Whether values are told in this phase (value propagation)."""
        phase, variant = self.cycle, self.settings.variant
        if variant == "AD" or phase < FIRST_WITH_VALUES:
            return False
        return variant == "ADVP" or (phase - FIRST_WITH_VALUES) % PERIOD < PERIOD - 1

    def _hear(self, name: str, message: wire.Message) -> None:
        """Keep what a robot has told. A value rules out all others; a domain says that nothing is known of the own one.

        A robot whose functions are others than before, as a domain has come late, sends other rows, or takes others.
        """
        if isinstance(message, R) and name in self.below:
            self.from_below[name] = checked(message.rows, len(message.rows), len(self.preferred))
        elif isinstance(message, Domain) and name in self.above:
            self._domains.update(self.checked_domains({name: message}))
            self._make_functions()
        elif isinstance(message, Domain):
            self.from_below.pop(name, None)
        elif name not in self._domains:
            return
        elif isinstance(message, Value):
            values = self._domains[name]
            row = [INFINITE] * len(values)
            row[values.index(message.value)] = 0.0
            self.functions.hear(name, [row] * len(self.functions.q[name]))
        elif isinstance(message, Q) and len(message.rows) == len(self.functions.q[name]):
            self.functions.hear(name, message.rows)

    def receive_late(self, sender: str, message: wire.Message) -> None:
        """Note what is new in a message whose phase is over."""
        if isinstance(message, R | Q | Domain):
            self._hear(sender, message)

    # Equations

    @property
    def _rows(self) -> list[Row]:
        """All R: of the own functions, then of those of each robot below."""
        return [*self.own, *(row for rows in self.from_below.values() for row in rows)]

    def _choose(self) -> bool:
        """Take the cheapest value. Return False if that has proven that there is no solution."""
        rows = self._rows
        z = total(self.preferred, rows)
        if min(z) < INFINITE:
            self.choose(cheapest(z))
            return True
        if self.settings.variant == "AD" or self.cycle + 1 < FIRST_WITH_VALUES:
            self.conclude(Verdict.NO_SOLUTION)
            return False
        columns = list(zip(self.preferred, *rows, strict=True))
        burdens = [(column.count(INFINITE), sum(cost for cost in column if cost < INFINITE)) for column in columns]
        self.choose(burdens.index(min(burdens)))
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
