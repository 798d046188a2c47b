"""Hybrid Asynchronous Backtracking (ABT-Hyb).

ABT that waits after a nogood. A robot of ABT without a value left sends a nogood, assumes that its receiver changes
the value, and takes a new value at once, often against what other robots are about to tell it. A robot of ABT-Hyb
sends nothing until it knows that the conflict is over. So fewer values and fewer nogoods go astray.

- **When to use**: no costs, and messages are what counts.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Space is polynomial.
- **Parameters**: none.
- **Reference**: Brito, Meseguer: "Synchronous, asynchronous and hybrid algorithms for DisCSP", CP 2004. Only a digest
  of the paper was at hand. The parts that are not here are ABT's (`abt.py`), with the same methods.

The rules of waiting, and where they are:

    a robot waits once it has sent a nogood         `_backtracked`
    it waits until a value is consistent again      `_check_agent_view`
    or until the nogood's receiver sends a value    `_process_info`
    while it waits it refuses nogoods               `_resolve_conflict` (ABT's: it has no value that one could be about)

While it waits, a robot keeps its view as it is: it does not forget the value of the nogood's receiver. So the stored
nogoods, one for each value, stay as well, and the wait ends only with a change that matters.

No robot waits for ever. The receiver of a nogood about another value than its own has sent its value after the one that
the nogood is about, so that value is on its way. If the nogood is about the current value but old in something else,
the receiver sends its value again. This ends the wait also though the value is the same: the sender's view is newer by
then, or it sends the nogood anew. If the receiver accepts the nogood, it sends the next value that it takes. It may
have to wait itself before, but only for a robot of higher priority, and the highest of those that wait is answered by a
robot that does not. A robot without a value has sent nothing that a nogood could be about: it drops a nogood, and
sends its next value to all who have a link to it, the nogood's sender among them.

What it leaves open is chosen as in ABT: n-ary constraints, packets, the choice among nogoods, interchangeable values,
partially known constraints. A robot that waits tests no pairs of partially known constraints, as it has no value; it
tests all of them once it has one.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> for protocol in ("abt", "abt-hyb"):
...     outcome = solve(queens3d(4), Options(protocol=protocol, runtime=Runtime.SIMULATOR))
...     print(outcome.verdict.value, sum(outcome.metrics.messages.values()))
no-solution 656
no-solution 416
"""

from __future__ import annotations

from robochoc.model.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.compiled import LocalProblem


class ABTHyb(ABT):
    """One agent of ABT-Hyb. State besides ABT's: `awaited`, the receiver of the last nogood, whose value is awaited."""

    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Brito & Meseguer 2004",
        partially_known=True,
        privacy="constraints of lower robots; of PKCs every robot's part, but for the pairs that were asked about",
        use_when="no costs, and messages are what counts",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.awaited: str | None = None

    def _process_info(self, sender: str, value: Value) -> None:
        """Store a value; the one that was waited for ends the wait, even if it is the same."""
        super()._process_info(sender, value)
        if sender == self.awaited:
            self.awaited = None

    def _check_agent_view(self) -> None:
        """Keep the value if the view allows it; otherwise choose another, backtrack, or go on waiting."""
        if self.value is not None and self._consistent(self.value, self.view):
            return
        self.value = self._choose_value(self.view)
        if self.value is not None:
            self.awaited = None
            self._tell(self.problem.values[self.value])
        elif self.awaited is None:
            self._backtrack()

    def _backtracked(self, culprit: str) -> None:
        """Wait after a nogood to `culprit`, and keep the view and the stored nogoods."""
        self.awaited = culprit
