"""Asynchronous Distributed Optimization (ADOPT).

Complete, best-first search for minimum cost on a pseudo-tree. Each robot takes the value with the least lower bound,
based on the costs that its children report, and changes it as soon as its lower bound is above the threshold. So it may
leave a value and return to it; the threshold, split among the children, lets them rebuild earlier solutions quickly.
The search ends when the root has LB = UB.

- **When to use**: to compare with BnB-ADOPT+, which needs fewer messages.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. The number of
  messages is exponential, memory is linear in values and children.
- **Parameters**: none.
- **References**: Modi, Shen, Tambe, Yokoo: "Adopt: asynchronous distributed constraint optimization with quality
  guarantees", Artificial Intelligence 161(1-2), 2005, Section 3.

The methods have the names of the paper's procedures:

    initialize     `start_in_tree`                 maintainThresholdInvariant        `_maintain_threshold_invariant`
    when received  `handle`                maintainChildThresholdInvariant   `_maintain_child_threshold_invariant`
    backTrack      `decide`, `act`         maintainAllocationInvariant       `_maintain_allocation_invariant`

Choices that the paper leaves open, and differences:

- The robots build the pseudo-tree themselves (`dfs`); each connected component has its own.
- One decision is made for all waiting messages.
- Constraints may be n-ary (the robot that is lowest in the tree in the scope pays, once it knows all other values) and
  hard (LB may become infinite; then a root ends the search).
- UB is infinite until the values of all neighbours above are known.
- A value in a context has a counter, as in BnB-ADOPT (`bnb_adopt`); the larger counter wins, from any sender. Without
  it, late costs would restore obsolete values of robots further up.
- No message is repeated (Gutierrez, Meseguer: "Saving redundant messages in ADOPT-based algorithms", DCR workshop
  2010). The paper's robots repeat messages; under a slow schedule these would accumulate without end. Therefore a
  robot stores the last threshold, which is valid whenever its context is, and keeps the better of two bounds in one
  context.
- The context of a threshold contains only the values on which the child's subtree depends.

Termination: at quiescence all robots have terminated. Otherwise there is a highest robot that has not: its threshold is
below UB. All contexts agree, so all robots have their parents' bounds and thresholds. With LB(d) <= threshold < UB(d)
for its value d, some child has t < ub. At that child, the threshold is again below UB. The argument repeats down to a
leaf, where LB = UB: a contradiction.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), ADOPT, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, assert_never, cast

from robochoc.model.problem import INFINITE
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.adopt_messages import Cost, Threshold, Value
from robochoc.protocols.optimization.bounding import BoundingProtocol, clamp_share, split_threshold
from robochoc.protocols.optimization.bounding_messages import Entry, Number, Terminate
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class ADOPT(BoundingProtocol):
    """One agent of ADOPT. State besides the bounds: `threshold`, and the children's shares of it, `t`.

    `parent_threshold` is the last Threshold that the parent sent.
    """

    messages: ClassVar[Any] = TreeMessage | Value | Cost | Threshold | Terminate
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Modi, Shen, Tambe, Yokoo 2005",
        costs=True,
        upper_bound=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="to compare with BnB-ADOPT+, which needs fewer messages",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.threshold: Number = 0
        self.parent_threshold = Threshold(0, {})
        self.t: dict[str, list[Number]] = {}

    def handle(self, sender: str, message: Message) -> None:
        if self.terminated:
            return
        match cast("Value | Cost | Threshold | Terminate", message):
            case Value(value, counter):
                self.merge({sender: (value, counter)})
            case Cost(context, lb, ub):
                self._store_cost(sender, context, lb, ub)
            case Threshold() as threshold:
                self.parent_threshold = threshold
            case Terminate(context):
                self.last_values = True
                self.merge(context)
            case never:
                assert_never(never)

    def act(self) -> None:
        """Choose a value and send the values, thresholds and costs that have changed (backTrack)."""
        self._maintain_threshold_invariant()
        self._choose()
        value = Value(*self.own)
        for name in self.descendants:
            self.send_if_new(name, value)
        self._maintain_allocation_invariant()
        if self.threshold == self.ub and self.may_end:
            self.terminate()
        elif self.parent is not None and not self.last_values:
            self.send_if_new(self.parent, Cost(dict(self.context), self.lb, self.ub))

    def _choose(self) -> None:
        if self.threshold == self.ub:
            self.assign(self.cheapest(self.upper))
        elif self.lower[self.index] > self.threshold:
            self.assign(self.cheapest(self.lower))

    def _store_cost(self, child: str, context: Mapping[str, Entry], lb: Number, ub: Number) -> None:
        self.merge(context)
        index = self.bound(child, context, lb, ub)
        if index is not None:
            self._maintain_child_threshold_invariant(child, index)

    def forget(self, child: str) -> None:
        """Drop the bounds on `child`, and reset its share of the threshold."""
        super().forget(child)
        self.t[child] = [0] * len(self.problem.values)

    # Invariants

    def _maintain_threshold_invariant(self) -> None:
        """Set the threshold: LB <= threshold <= UB; use the parent's if its context is current."""
        if self.agrees(self.parent_threshold.context):
            self.threshold = self.parent_threshold.threshold
        self.threshold = min(max(self.threshold, self.lb), self.ub)

    def _maintain_child_threshold_invariant(self, child: str, index: int) -> None:
        """Clamp the child's share: lb(d, l) <= t(d, l) <= ub(d, l)."""
        clamp_share(self.t[child], self.bounds[child], index)

    def _maintain_allocation_invariant(self) -> None:
        """Split the threshold into this robot's cost and the children's shares; send the shares."""
        index = self.index
        if self.threshold == INFINITE:  # no value is possible in this context; the parent will learn this
            return
        split_threshold(self.threshold - self.delta[index], self.t, self.bounds, index)
        for child, t in self.t.items():
            scope = self.bounds[child].scope
            context = {name: value for name, (value, _) in self.context.items() if name in scope}
            self.send_if_new(child, Threshold(t[index], context))
