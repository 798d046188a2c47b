"""Synchronous Branch and Bound (SyncBB).

Distributed branch and bound. One path, which contains the values of the robots so far and the cost of each, goes from
robot to robot in priority order. Its holder adds its first value with which the path costs less than the bound n (the
cost of the best path so far), and sends the path on; if there is no such value, it sends the path back. A complete path
is the new best one. One robot acts at a time, so no message is ever obsolete.

- **When to use**: as a simple baseline with costs.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. The best path is
  optimal once the first robot has no value left. Space is linear.
- **Parameters**: none.
- **Reference**: Hirayama, Yokoo: "Distributed partial constraint satisfaction problem", CP 1997. The paper's cost is
  the largest number of constraints that one robot violates; here it is the sum of all costs.

The methods:

    extend the path   `_extend`     backtrack   `_backtrack`

Choices that the paper leaves open:

- Constraints may be n-ary. The lowest-priority robot in the scope pays them, when it holds the path.
- `Backtrack` contains only the values in the best path, because the previous robot still has its own path.
- The last robot looks for further, cheaper values before it sends the path back.
- A path that costs as much as a new bound goes back at once.
- A robot with an empty domain reports it at once.
- The first robot sends the best path to the others at the end, and each takes its value in it.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), SyncBB, Concurrent(seed=0)).run()
>>> result.verdict.value, result.witness
('no-solution', 'Robot1.1')
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, assert_never, cast

import msgspec

from robochoc.model.outcome import Verdict
from robochoc.protocols import acts
from robochoc.protocols.disclosure import EveryValuePays, HasValue, Pays, Proof, Reception, Total
from robochoc.protocols.findings import Findings, Incumbent
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text, incumbent_text
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr

Cost = int | float


class BestPath(msgspec.Struct, frozen=True, array_like=True):
    """The best path so far: the values of all robots in priority order, and its cost (the bound; `inf`: none yet)."""

    bound: Cost
    values: tuple[Value, ...] = ()


class Path(Message, frozen=True):
    """The values of all robots before the receiver, in priority order, with the cost that each of them pays."""

    assignments: list[tuple[Value, Cost]]
    best: BestPath

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        values = words.partial([value for value, _ in self.assignments])
        paid = cost_text(sum(cost for _, cost in self.assignments))
        known = incumbent_text(self.best.bound)
        return f"so far {values}, which costs {paid}; {known}; it is {words.receiver}'s turn"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        found = best_proves(self.best, reception)
        view: dict[str, Value] = {}
        for robot, (value, cost) in zip(reception.order, self.assignments, strict=False):
            found += [HasValue(robot, value), Pays(robot, value, dict(view), cost, cost)]
            view[robot] = value
        return found


class Backtrack(Message, frozen=True):
    """A request to take the next value: every path with the receiver's current value costs at least the bound."""

    best: BestPath

    act = acts.REJECT_VALUE
    backtracks = True

    def in_words(self, words: Wording) -> str:
        if math.isinf(self.best.bound):
            return f"{words.receiver}'s value leads to no solution: take another one"
        bound = cost_text(self.best.bound)
        return f"{words.receiver}'s value leads to nothing that costs less than {bound}: take another one"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        found = best_proves(self.best, reception)
        path = reception.last(Path, reception.receiver, reception.sender)
        if path is not None and reception.is_lowest(reception.sender):
            view = {robot: value for robot, (value, _) in zip(reception.order, path.assignments, strict=False)}
            left = self.best.bound - sum(cost for _, cost in path.assignments)
            found.append(EveryValuePays(reception.sender, view, left))
        return found


class Terminate(Message, frozen=True):
    """The end of the search: no path is cheaper than the best one found."""

    best: BestPath

    act = acts.TERMINATE

    def in_words(self, words: Wording) -> str:
        if math.isinf(self.best.bound):
            return "the search is over, and there is no solution"
        values = words.partial(self.best.values)
        return f"the search is over: nothing costs less than {cost_text(self.best.bound)}, with {values}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        stands = [HasValue(robot, value) for robot, value in zip(reception.order, self.best.values, strict=False)]
        return [*stands, *best_proves(self.best, reception)]


def best_proves(best: BestPath, reception: Reception) -> list[Proof]:
    """Return the proofs in the best path."""
    return [Total(dict(zip(reception.order, best.values, strict=False)), best.bound)] if best.values else []


@mypyc_attr(allow_interpreted_subclasses=True)
class SyncBB(Protocol):
    """One agent of SyncBB. State: the last `path` and its cost (`paid`), and the `best` path.

    `over`: whether this robot knows that the best path is optimal.
    """

    messages: ClassVar[Any] = Path | Backtrack | Terminate
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Hirayama & Yokoo 1997",
        synchronous=True,
        costs=True,
        upper_bound=True,
        privacy="constraints of lower robots",
        use_when="a simple baseline with costs",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.rank = order.rank[problem.agent]
        self.path: list[tuple[Value, Cost]] = []
        self.paid: Cost = 0
        self.best = BestPath(problem.upper_bound)
        self.over = False
        self._view: dict[str, Value] = {}

    def start(self) -> None:
        """Create the path, as the first robot; other robots wait for it."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif self.rank == 0:
            self._extend(0)

    def receive(self, sender: str, message: Message) -> None:  # noqa: ARG002 - only neighbours in the order speak
        if self.verdict is not None:
            return
        match cast("Path | Backtrack | Terminate", message):
            case Path(assignments, best):
                self.best = best
                self.path = assignments
                self.paid = sum(cost for _, cost in assignments)
                names = zip(self.order.names, assignments, strict=False)
                self._view = {name: value for name, (value, _) in names}
                self._extend(0)
            case Backtrack(best):
                self.best = best
                self._extend(0 if self.value is None else self.value + 1)
            case Terminate(best):
                self.best = best
                self._adopt_best()
            case never:
                assert_never(never)

    @property
    def incumbent(self) -> Incumbent | None:
        """The best path."""
        return (
            Incumbent(self.best.bound, dict(zip(self.order.names, self.best.values, strict=True)))
            if self._known
            else None
        )

    @property
    def findings(self) -> Findings:
        """The best path; for the first robot also a lower bound on all paths."""
        return Findings(best=self.incumbent, bound=self._lower_bound if self.rank == 0 else None)

    def _extend(self, first: int) -> None:
        """Add the first value from index `first` on that makes the path cheaper than the best; otherwise backtrack."""
        for index in range(first, len(self.problem.values)):
            if self.paid >= self.best.bound:
                break
            cost = self.problem.cost(index, self._view)
            if self.paid + cost < self.best.bound:
                self.value = index
                if self._pass_on(cost):
                    return
        self._backtrack()

    def _pass_on(self, cost: Cost) -> bool:
        """Send on the path with this robot's value and its `cost`. Return False if it is complete and so the best."""
        path = [*self.path, (self.problem.values[self.value or 0], cost)]
        if self.rank + 1 < len(self.order.names):
            self.send(self.order.names[self.rank + 1], Path(path, self.best))
            return True
        self.best = BestPath(self.paid + cost, tuple(value for value, _ in path))
        return False

    def _backtrack(self) -> None:
        """Send the path back to the previous robot; the first robot ends the search."""
        self.value = None
        if self.rank > 0:
            self.send(self.order.names[self.rank - 1], Backtrack(self.best))
        elif self._known:
            self._adopt_best()
            for robot in self.order.names[1:]:
                self.send(robot, Terminate(self.best))
        else:
            self.conclude(Verdict.NO_SOLUTION)

    def _adopt_best(self) -> None:
        """Adopt this robot's value in the best path, at the end of the search."""
        self.over = True
        self.value = self.problem.values.index(self.best.values[self.rank])

    @property
    def _lower_bound(self) -> Cost | None:
        """A lower bound on every path, known to the first robot; None before it begins."""
        if self.over:
            return self.best.bound
        if self.value is None:
            return None
        return min(self.best.bound, *self.problem.charges[self.value :])

    @property
    def _known(self) -> bool:
        """True if a best path is known."""
        return bool(self.best.values)
