"""Max-Sum with alternating directions (Max-Sum_AD, ADVP, ADSSVP).

Max-Sum on a graph whose edges all have one direction in one phase, and the other direction in the next. The graph of a
phase has no cycles, so its messages settle. From the third phase on, robots may also send their values instead of the
costs of all values (value propagation): then the others respond to an actual value, and the search settles permanently.

- **When to use**: costs, and a graph with many cycles, on which Max-Sum does not settle.
- **Guarantees**: incomplete; it stops after `cycles` phases. AD is optimal on a graph without cycles after one phase
  more than the longest path has turns between higher and lower robots: two phases in a tree's order (`--order dfs`).
  ADVP settles, if constraints are between two robots: from phase 4 on the cost never rises, and in the end no robot
  alone can do better. The result is the best phase (anytime). A robot whose values all cost `inf`, before any values
  have been sent, proves that there is no solution.
- **Parameters (`--set`)**: `variant` (`AD`; `ADVP`, value propagation from phase 3 on; `ADSSVP`, the same, but not in
  every third phase; default `ADSSVP`), `preference` (the maximum random charge of a value; default 0.01), `cycles` (the
  number of phases; default 100).
- **References**: Zivan, Parash, Cohen, Peled, Okamoto: "Balancing exploration and exploitation in incomplete
  Min/Max-sum inference for distributed constraint optimization", JAAMAS 31(5), 2017; for ADSSVP: Chen, Deng, Wu: "An
  iterative refined Max-sum_AD algorithm via single-side value propagation and local search", AAMAS 2017.

The nodes are those of Max-Sum (`maxsum`); a function is placed just before the robot that holds it, the lowest of its
scope. In odd phases messages go up: robots send R, from a function to the robots above. In even phases they go down:
robots send Q to the functions of those below. The last messages of the other direction are stored, and count.

Choices that the papers leave open, and differences:

- In the paper a phase has as many rounds as the longest path has nodes, and each round has a message on each edge. Here
  a robot waits for all robots above it (or below it), and sends its messages once. These are the messages of the last
  round, with one message for each pair of neighbours and phase.
- The first phase goes up, because only holders know how many functions there are.
- A value counts as a Q that excludes all other values, so the same rule computes R from both.
- If all values cost `inf` because of received values, a robot chooses the value that violates the fewest functions. Its
  Q is then all 0.
- If messages are lost, the last R and Q are used. A robot without R from a robot below sends its domain again, and a
  function with unknown domains is left out; its holder requests the domain. Then the cost may rise.
- With constraints between three or more robots, a robot may respond to values from the previous phase. Then ADVP need
  not settle.

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
from robochoc.protocols.inference.maxsum import FactorGraphProtocol, Q, R
from robochoc.protocols.inference.maxsum_factor import Functions, Row, cheapest, checked, from_zero, total, without_each
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleSettings, Domain, Value
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem


class MaxSumADSettings(CycleSettings, frozen=True):
    """`variant`: AD, ADVP or ADSSVP. `preference`: its maximum for a value. `cycles`: the number of phases."""

    variant: Literal["AD", "ADVP", "ADSSVP"] = "ADSSVP"
    preference: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.preference < INFINITE:
            raise ValueError(f"preference is {self.preference:g}; it must be a number, 0 or more")


FIRST_WITH_VALUES = 3
"""The first phase in which values may be sent: both directions have been used before it."""
PERIOD = 3
"""ADSSVP sends no values in every third phase."""


class MaxSumAD(FactorGraphProtocol):
    """One agent of Max-Sum_AD. A cycle is a phase.

    `functions` are this robot's functions, with the last Q from above. `from_below` contains the last R from each robot
    below, `own` the last R from this robot's functions.
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
        self.functions = Functions([], {})
        self.from_below: dict[str, list[Row]] = {}
        self.own: list[Row] = []
        self._nothing: list[Row] = []

    def start_cycles(self) -> None:
        self.start_with(self.settings.preference)

    def _receive_domains(self, messages: Mapping[str, wire.Message]) -> None:
        """Make this robot's functions from the received domains."""
        self._domains = self.checked_domains(messages)
        self._make_functions()
        self.listen(self.below, self._phase_up)

    def _make_functions(self) -> None:
        """Create the functions whose robots' domains are known."""
        self.functions = Functions(self.problem.tables(self._domains), self._domains)
        self._nothing = [[0.0] * len(self.preferred) for _ in self.functions.factors]
        self.own = self._nothing

    # Phases

    def _phase_up(self, messages: Mapping[str, wire.Message]) -> None:
        """Process R from below, choose a value, and send R to the robots above."""
        for name, message in messages.items():
            self._record(name, message)
        if not self._choose():
            return
        _, r = self.functions.answers(self._q()[: len(self._nothing)])
        for name in self.above:
            self.send(name, R(r[name]) if name in r else Domain(list(self.problem.values)))
        if not self.finished:
            self.listen(self.above, self._phase_down)

    def _phase_down(self, messages: Mapping[str, wire.Message]) -> None:
        """Process Q or values from above, choose a value, and send Q or the value to the robots below."""
        for name, message in messages.items():
            self._record(name, message)
        self.own, _ = self.functions.answers(self._nothing)
        if not self._choose():
            return
        rows = iter(self._q()[len(self._nothing) :])
        answers: dict[str, Q | Value]
        if self._sends_values:
            answers = dict.fromkeys(self.from_below, Value(self.problem.values[self.present]))
        else:
            answers = {name: Q([next(rows) for _ in r]) for name, r in self.from_below.items()}
        for name in self.below:
            self.send(name, answers.get(name) or Domain(list(self.problem.values)))
        if not self.finished:
            self.listen(self.below, self._phase_up)

    @property
    def _sends_values(self) -> bool:
        """True if values are sent in this phase (value propagation)."""
        phase, variant = self.cycle, self.settings.variant
        if variant == "AD" or phase < FIRST_WITH_VALUES:
            return False
        return variant == "ADVP" or (phase - FIRST_WITH_VALUES) % PERIOD < PERIOD - 1

    def _record(self, name: str, message: wire.Message) -> None:
        """Store a message. A value excludes all others; a domain shows that its sender lacks this robot's domain.

        R and Q for functions that have changed since, because a domain arrived late, have another number of rows.
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
            self.functions.receive_q(name, [row] * len(self.functions.q[name]))
        elif isinstance(message, Q) and len(message.rows) == len(self.functions.q[name]):
            self.functions.receive_q(name, message.rows)

    def receive_late(self, sender: str, message: wire.Message) -> None:
        """Store the new information in a message whose phase is over."""
        if isinstance(message, R | Q | Domain):
            self._record(sender, message)

    # Equations

    @property
    def _rows(self) -> list[Row]:
        """All R: from this robot's functions, then from the functions of each robot below."""
        return [*self.own, *(row for rows in self.from_below.values() for row in rows)]

    def _choose(self) -> bool:
        """Choose the cheapest value. Return False if that proves that there is no solution."""
        rows = self._rows
        z = total(self.preferred, rows)
        if min(z) < INFINITE:
            self.choose(cheapest(z))
            return True
        if self.settings.variant == "AD" or self.cycle + 1 < FIRST_WITH_VALUES:
            self.conclude(Verdict.NO_SOLUTION)
            return False
        columns = list(zip(self.preferred, *rows, strict=True))
        costs = [(column.count(INFINITE), sum(cost for cost in column if cost < INFINITE)) for column in columns]
        self.choose(costs.index(min(costs)))
        return True

    def _q(self) -> list[Row]:
        """Return Q to each function: the cost of each value in all other functions; or only the value, if sent."""
        rows = self._rows
        if self._sends_values:
            alone = [INFINITE] * len(self.preferred)
            alone[self.present] = 0.0
            return [alone] * len(rows)
        fresh = without_each(self.preferred, rows, total(self.preferred, rows))
        return [from_zero(row) if min(row) < INFINITE else [0.0] * len(row) for row in fresh]
