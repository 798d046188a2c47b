"""Hybrid Asynchronous Backtracking (ABT-Hyb).

ABT that waits after a nogood. In ABT, a robot without a value left sends a nogood, assumes that the receiver changes
its value, and takes a new value at once, which often conflicts with messages in transit. In ABT-Hyb, the robot sends
nothing until it knows that the conflict is over. So fewer values and nogoods are obsolete on arrival.

- **When to use**: no costs, and the number of messages matters most.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Space is polynomial.
- **Parameters**: none.
- **Reference**: Brito, Meseguer: "Synchronous, asynchronous and hybrid algorithms for DisCSP", CP 2004. Only a digest
  of the paper was available. All other methods are inherited from ABT (`abt.py`).

The rules of waiting, and where they are implemented:

    a robot waits once it has sent a nogood         `_after_backtrack`
    it waits until a value is consistent again      `_check_agent_view`
    or until the nogood's receiver sends a value    `_process_info`
    while it waits it refuses nogoods               `_resolve_conflict` (ABT's: it has no value to be ruled out)

While it waits, a robot keeps its view as it is: it does not forget the value of the nogood's receiver. So the stored
nogoods, one for each value, stay as well, and the wait ends only with a relevant change.

No robot waits for ever. If a nogood is about another value than the receiver's current one, the receiver has sent its
current value later, so that value is in transit. If the nogood is about the current value but otherwise outdated, the
receiver sends its value again. This ends the wait although the value is the same: either the sender's view is newer by
then, or the sender repeats the nogood. If the receiver accepts the nogood, it sends its next value. It may have to wait
first, but only for a robot of higher priority, and the highest waiting robot is answered by a robot that does not wait.
A robot without a value drops nogoods, and sends its next value to all robots with a link to it, including the sender of
the nogood.

Choices that the paper leaves open are made as in ABT: n-ary constraints, packets, the choice among nogoods,
interchangeable values, partially known constraints. A waiting robot tests no pairs of partially known constraints,
because it has no value; it tests all of them once it has a value.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> for protocol in ("abt", "abt-hyb"):
...     outcome = solve(queens3d(4), Options(protocol=protocol, runtime=Runtime.SIMULATOR))
...     print(outcome.verdict.value, sum(outcome.metrics.messages.values()))
no-solution 656
no-solution 416
"""

from __future__ import annotations

from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem


class ABTHyb(ABT):
    """One agent of ABT-Hyb. State besides ABT's: `awaited`, the receiver of the last nogood, which owes a value."""

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
        """Store a value; the awaited value ends the wait, even if it is unchanged."""
        super()._process_info(sender, value)
        if sender == self.awaited:
            self.awaited = None

    def _check_agent_view(self) -> None:
        """Keep the value if the view allows it; otherwise choose another value, backtrack, or continue to wait."""
        if self.value is not None and self._consistent(self.value, self.view):
            return
        self.value = self._choose_value(self.view)
        if self.value is not None:
            self.awaited = None
            self._send_value(self.problem.values[self.value])
        elif self.awaited is None:
            self._backtrack()

    def _after_backtrack(self, culprit: str) -> None:
        """Wait after sending a nogood to `culprit`; keep the view and the stored nogoods."""
        self.awaited = culprit
