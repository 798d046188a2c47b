"""The Generalized Distributed Breakout Algorithm (GDBA).

Local search in cycles: MGM in which constraints weigh more the longer they keep robots in a local minimum. Each robot
has its own modifiers for the entries in its constraints' tables; a cost combined with its modifier is the effective
cost. All robots send their values, then the reduction of their effective cost by their best move; among neighbours the
robot with the largest reduction moves. If neither a robot nor any of its neighbours can reduce its cost (a quasi-local
minimum), the robot raises the modifiers of its violated constraints.

- **When to use**: costs, a large team, time for many cycles: it leaves the local optima in which MGM ends.
- **Guarantees**: incomplete; it stops after `cycles` cycles, without a proof of optimality. The result is the best
  cycle (anytime); costs rise and fall. A robot with an empty domain proves that there is no solution.
- **Parameters (`--set`)**: `modifier` (A or M; default M), `violation` (NZ, NM or MX; default NM), `scope` (E, R, C or
  T; default T), `cycles` (default 100). They are explained below; the defaults are the variant that later papers use.
- **References**: Okamoto, Zivan, Nahon: "Distributed breakout: beyond satisfaction", IJCAI 2016. For the algorithm that
  it generalizes: Yokoo, Hirayama: "Distributed breakout algorithm for solving distributed constraint satisfaction
  problems", ICMAS 1996.

The paper's three choices, 24 variants in all:

    effective cost: additive (A), multiplicative (M)                `modifier`, `_effective`
    violated: non-zero, non-minimum, maximum cost (NZ, NM, MX)      `violation`, `_violated`
    scope of a raise: entry, row, column, table (E, R, C, T)        `scope`, `_key`
    send value, send improvement, raise or move                     `exchange_values`, `send_improve`, `_move`

With A and R, or A and T, all values of a robot are raised equally, so no decision changes: these variants are exactly
MGM. E and C leave minima fastest, but never settle; their last cycle may be far from the best one.

Choices that the paper leaves open, and differences:

- A row (R) contains all values of the robot with the others' current values, a column (C) the robot's value with all
  values of the others.
- Constraints may be n-ary; then the others' current values are those of all other robots in the scope.
- A broken hard constraint counts as a cost larger than all others: costs are pairs as in `mgm`, and raising a broken
  constraint adds one broken constraint (A) or makes it count once more (M).
- A robot's private costs are not shared constraints, and are never raised.
- First values, equally good values, equal reductions and lost messages are treated as in `mgm`.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), GDBA, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Improve': 5600, 'Value': 5600}
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, Literal

from robochoc.model.problem import INFINITE
from robochoc.protocols import message as wire
from robochoc.protocols.local_search.mgm import Gain, Gainers, saving_in_words
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import NO_GAIN, CycleSettings, Value
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.encoding import Cost
from robochoc.solver.local_problem import Charged, LexicographicCost, LocalProblem
from robochoc.solver.shared_constraint import OtherValues
from robochoc.system.compiling import mypyc_attr


class GDBASettings(CycleSettings, frozen=True):
    """The rule by which a constraint that is violated in a quasi-local minimum weighs more from then on.

    `modifier`: A adds to its cost, M multiplies it. `violation`: NZ (its cost is not zero), NM (more than its minimum)
    or MX (its maximum). `scope`: E changes one entry of its table, R those of all the robot's values against the
    others' current ones, C those of the robot's value against all of theirs, T the whole table. `cycles`: the number of
    cycles.
    """

    modifier: Literal["A", "M"] = "M"
    violation: Literal["NZ", "NM", "MX"] = "NM"
    scope: Literal["E", "R", "C", "T"] = "T"


class Improve(Gain, frozen=True):
    """The reduction of the sender's effective cost by its best move: broken hard constraints, and costs (`improve`)."""

    def in_words(self, _: Wording) -> str:
        return f"as I weigh constraints by now, my move would save {saving_in_words(self.broken, self.cost)}"


Raised = tuple[int, int]
"""The numbers of raises: in cycles that broke the constraint, and in cycles in which it only had a cost."""

Key = tuple[int | None, OtherValues | None]
"""The entries of a table that are raised together: for one code of this robot's values, for others' values, or all."""

MOST = 1 << 62
"""The largest reduction that is sent: effective costs may exceed the integers of a message."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Breakout(Gainers):
    """The common base of GDBA and DGLS. A cycle has two phases: all robots send their values, then their reductions."""

    improve: ClassVar[type[Improve]] = Improve

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.charged: list[Charged] = []

    @abstractmethod
    def effective_costs(self) -> list[LexicographicCost]:
        """Return the effective cost of each of this robot's values; `charged` are its costs in each constraint."""

    def start_cycle(self, view: Mapping[str, wire.Value], messages: Mapping[str, wire.Message]) -> None:
        """Process the neighbours' messages with their values; `view` are these values."""

    @abstractmethod
    def penalise(self) -> None:
        """Penalise the violated constraints, in a quasi-local minimum."""

    def start_cycles(self) -> None:
        """Choose a random value."""
        self.choose(self.any_value())
        self.exchange_values(self.send_improve)

    def send_improve(self, messages: Mapping[str, wire.Message]) -> None:
        """Send the reduction by this robot's best move, once all neighbours' values are known."""
        view = self.checked_values(messages)
        self.start_cycle(view, messages)
        self.charged = self.problem.charged(view)
        self.find_best_move(self.effective_costs())
        broken, cost = self.gain
        self.gain = broken, max(-MOST, min(MOST, cost))
        self.multicast(self.problem.neighbours, self.improve(*self.gain))
        self.listen(self.problem.neighbours, self._move)

    def _move(self, messages: Mapping[str, wire.Message]) -> None:
        """Move if this robot's reduction is the largest; penalise constraints in a quasi-local minimum."""
        complete = len(messages) == len(self.problem.neighbours)
        others = [(message.broken, message.cost) for message in messages.values() if isinstance(message, Improve)]
        if complete and max(self.gain, *others) <= NO_GAIN:
            self.penalise()
        self.choose(self.target if complete and self.wins(messages) else self.present)
        if not self.finished:
            self.exchange_values(self.send_improve)


@mypyc_attr(allow_interpreted_subclasses=True)
class GDBA(Breakout):
    """One agent of GDBA.

    `raised` are the modifiers: for each constraint, by its number, the number of raises of its entries.
    """

    messages: ClassVar[Any] = Value | Improve | AnytimeMessage
    settings: ClassVar[GDBASettings] = GDBASettings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Okamoto, Zivan, Nahon 2016",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        use_when="as MGM, and many cycles: it leaves local optima",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.raised: dict[int, dict[Key, Raised]] = {}
        self._ranges: dict[int, tuple[Cost, Cost]] = {}

    def effective_costs(self) -> list[LexicographicCost]:
        """Return the effective cost of each of this robot's values."""
        alone = [pair(cost) for cost in self.problem.charges]
        return summed([alone, *(self._effective(one) for one in self.charged)])

    def _effective(self, charged: Charged) -> Sequence[LexicographicCost]:
        """Return the effective cost of each of this robot's values in one constraint."""
        raised = self.raised.get(charged.number)
        if raised is None:
            return [pair(cost) for cost in charged.costs]
        weighed = self._added if self.settings.modifier == "A" else self._multiplied
        return [
            weighed(cost, raised.get(self._key(code, charged.others), (0, 0)))
            for code, cost in zip(charged.codes, charged.costs, strict=True)
        ]

    @staticmethod
    def _added(cost: Cost, raised: Raised) -> LexicographicCost:
        broken, paid = pair(cost)
        return broken + raised[0], paid + raised[1]

    @staticmethod
    def _multiplied(cost: Cost, raised: Raised) -> LexicographicCost:
        broken, paid = pair(cost)
        times = 1 + raised[0] + raised[1]
        return broken * times, paid * times

    def penalise(self) -> None:
        """Raise the modifiers of the violated constraints (increase-mod)."""
        for number, others, codes, costs in self.charged:
            cost = costs[self.present]
            if self._violated(number, cost):
                raised = self.raised.setdefault(number, {})
                key = self._key(codes[self.present], others)
                broken, paid = raised.get(key, (0, 0))
                raised[key] = (broken + 1, paid) if cost == INFINITE else (broken, paid + 1)

    def _violated(self, number: int, cost: Cost) -> bool:
        """Return whether a constraint whose cost is `cost` is violated (is-violated)."""
        if self.settings.violation == "NZ":
            return cost > 0
        if number not in self._ranges:
            self._ranges[number] = self.problem.least_and_most(number)
        least, most = self._ranges[number]
        return cost > least if self.settings.violation == "NM" else cost == most

    def _key(self, code: int, others: OtherValues) -> Key:
        """Return the key of all entries that are raised together with the entry for `code` and the others' values."""
        scope = self.settings.scope
        return code if scope in "EC" else None, others if scope in "ER" else None


def pair(cost: Cost) -> LexicographicCost:
    """Return a cost as a number of broken hard constraints and a finite cost."""
    return (1, 0) if cost == INFINITE else (0, cost)


def summed(rows: Iterable[Sequence[LexicographicCost]]) -> list[LexicographicCost]:
    """Return the sum of each column."""
    return [(sum(broken for broken, _ in row), sum(cost for _, cost in row)) for row in zip(*rows, strict=True)]
