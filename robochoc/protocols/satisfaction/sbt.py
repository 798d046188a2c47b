"""Synchronous Backtracking (SBT).

Distributed chronological backtracking. One current partial assignment (CPA) goes from robot to robot in priority order.
Its holder adds its first consistent value and sends the CPA on; if there is no such value, it sends the CPA back. One
robot acts at a time, so no message is ever obsolete.

- **When to use**: as a simple baseline without costs.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Space is linear.
- **Parameters**: none.
- **References**: Yokoo, Durfee, Ishida, Kuwabara: "The distributed constraint satisfaction problem: formalization and
  algorithms", IEEE TKDE 10(5), 1998, Section on synchronous backtracking (first in ICDCS 1992); as a baseline also in
  Zivan, Meisels: "Synchronous vs asynchronous search on DisCSPs", EUMAS 2003.

The methods:

    add a value, send the CPA on   `_assign`     send the CPA back   `_backtrack`

Choices that the papers leave open:

- Constraints may be n-ary. The lowest-priority robot in the scope checks them, when it holds the CPA.
- `Backtrack` contains no assignments, because the previous robot still has its own CPA.
- A robot with an empty domain reports it at once.
- The last robot concludes with a solution, because all others still have the values in the CPA.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> outcome = solve(queens3d(4), Options(protocol="sbt", runtime=Runtime.SIMULATOR))
>>> outcome.verdict.value, outcome.witness
('no-solution', 'Robot1.1')
"""

from __future__ import annotations

from typing import Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.sbt_messages import CPA, Backtrack
from robochoc.protocols.traits import ENDS_WITH_EITHER, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class SBT(Protocol):
    """One agent of synchronous backtracking. State: the last `cpa`, and the value that was added to it."""

    messages: ClassVar[Any] = CPA | Backtrack
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_EITHER,
        paper="Yokoo et al. 1992, 1998; Zivan & Meisels 2003",
        synchronous=True,
        privacy="constraints of lower robots",
        use_when="a simple baseline without costs",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.rank = order.rank[problem.agent]
        self.cpa: tuple[Value, ...] = ()
        self._view: dict[str, Value] = {}

    def start(self) -> None:
        """Create the CPA, as the first robot; other robots wait for it."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif self.rank == 0:
            self._assign(0)

    def receive(self, sender: str, message: Message) -> None:  # noqa: ARG002 - only neighbours in the order speak
        if self.verdict is not None:
            return
        match cast("CPA | Backtrack", message):
            case CPA(assignments):
                self.cpa = assignments
                self._view = dict(zip(self.order.names, assignments, strict=False))
                self._assign(0)
            case Backtrack():
                self._assign(0 if self.value is None else self.value + 1)
            case never:
                assert_never(never)

    def _assign(self, first: int) -> None:
        """Add the first value from index `first` on that agrees with the CPA, and send it on; else backtrack."""
        candidates = range(first, len(self.problem.values))
        self.value = next((index for index in candidates if self.problem.conflict(index, self._view) is None), None)
        if self.value is None:
            self._backtrack()
        elif self.rank + 1 == len(self.order.names):
            self.conclude(Verdict.SOLUTION)
        else:
            self.send(self.order.names[self.rank + 1], CPA((*self.cpa, self.problem.values[self.value])))

    def _backtrack(self) -> None:
        """Send the CPA back to the robot before; the first robot ends the search."""
        if self.rank == 0:
            self.conclude(Verdict.NO_SOLUTION)
        else:
            self.send(self.order.names[self.rank - 1], Backtrack())

    def tried(self, index: int) -> bool:
        """Return whether the value at `index` has been tried: values are taken in their order."""
        return self.value is not None and index < self.value
