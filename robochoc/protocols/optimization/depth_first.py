"""The search of BnB-ADOPT+ itself; the subclasses decide when it begins (`bnb_adopt`, `bnb_adopt_fdac`).

A robot keeps its value until LB(d) reaches the cost of the best known complete solution (UB), or its threshold (TH).
The rules, the choices that the paper leaves open, and the proof of termination are in `bnb_adopt`.
"""

from __future__ import annotations

from typing import assert_never, cast

import msgspec

from robochoc.model.problem import INFINITE
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.bnb_adopt_messages import Cost, Value
from robochoc.protocols.optimization.bounding import BoundingProtocol
from robochoc.protocols.optimization.bounding_messages import Context, Number, Terminate
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class DepthFirstProtocol(BoundingProtocol):
    """One agent in the search of BnB-ADOPT+. State besides the bounds: `threshold` (TH).

    `sent_values` are the last Values sent to each child, `sent_cost` is the last Cost, without its threshold request.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.threshold: Number = INFINITE
        self.threshold_request = False
        self.sent_values: dict[str, Value] = {}
        self.sent_cost: Cost | None = None
        self._moved = False

    def start_in_tree(self) -> None:
        """Initialise the bounds; the threshold of a root is the known upper bound of the cost."""
        super().start_in_tree()
        if self.parent is None:
            self.threshold = self.problem.upper_bound

    def handle(self, sender: str, message: Message) -> None:
        """Process a message of the search; the message types are those in the subclass's `messages`."""
        if self.terminated:
            return
        match cast("Value | Cost | Terminate", message):
            case Value(value, counter, threshold):
                self._merge({sender: (value, counter)})
                if sender == self.parent:
                    self.threshold = threshold
                    self.threshold_request = False
            case Cost() as cost:
                self._merge(cost.context)
                self.bound(sender, cost.context, cost.lb, cost.ub)
                if cost.threshold_request:
                    self.sent_values.pop(sender, None)
            case Terminate(context):
                self._merge(context)
                self.threshold = INFINITE
                self.last_values = True
            case never:
                assert_never(never)

    # Contexts and thresholds

    def _merge(self, context: Context) -> None:
        """Merge a context; if it changed, choose the value again and reset TH (InitSelf)."""
        news, changed = self.merge(context)
        self._moved = self._moved or bool(news)
        if changed:
            self.drop_threshold()

    def drop_threshold(self) -> None:
        """Forget the threshold for the previous context, and request a new one."""
        self.threshold = INFINITE
        self.threshold_request = True

    def act(self) -> None:
        """Choose a value and send the values and costs that have changed (Backtrack)."""
        self._choose()
        self.send_values()
        for name in self.pseudo_children:
            self.send_if_new(name, self.value_for(name))
        if self.settled and self.may_end:
            self.terminate()
        elif not self.may_end:
            self._send_cost()

    def _choose(self) -> None:
        if self.settled:
            self.assign(self.cheapest(self.upper))
        elif self._moved or self.leaves:
            self.assign(self.cheapest(self.lower))
        self._moved = False

    @property
    def settled(self) -> bool:
        """True if the value with the least upper bound is good enough."""
        return self.ub <= self.lb

    @property
    def leaves(self) -> bool:
        """True if the value must be left: its lower bound reaches UB or TH."""
        return self.lower[self.index] >= min(self.threshold, self.ub)

    # Sending

    def send_values(self) -> None:
        """Send each child what has changed for it."""
        for child in self.children:
            self._send_value(child)

    def _send_value(self, child: str) -> None:
        """Send `child` a new value, a higher threshold, or a threshold that it has requested."""
        value, last = self.value_for(child), self.sent_values.get(child)
        if last is None or self.must_send(value, last):
            self.sent_values[child] = value
            self.send(child, value)

    def value_for(self, name: str) -> Value:
        """Return this robot's value, and the threshold of `name` if it is a child."""
        return Value(*self.own, self.share(name) if name in self.bounds else INFINITE)

    def must_send(self, value: Value, last: Value) -> bool:
        """Return whether `value` must be sent to a child that was sent `last`."""
        return last.counter < value.counter or last.threshold < value.threshold

    def share(self, child: str) -> Number:
        """Return the part of the threshold left for `child` if other children cost their lower bounds."""
        limit = min(self.threshold, self.ub)
        if limit == INFINITE:
            return INFINITE
        others = sum(bounds.lb[self.index] for name, bounds in self.bounds.items() if name != child)
        return max(0, limit - self.delta[self.index] - others)

    def _send_cost(self) -> None:
        """Send the parent new bounds, bounds in a new context, or a request for the threshold."""
        cost = self.bounds_for_parent()
        if self.parent is not None and (self.threshold_request or cost != self.sent_cost):
            self.sent_cost = cost
            self.send(self.parent, msgspec.structs.replace(cost, threshold_request=self.threshold_request))
            self.threshold_request = False

    def bounds_for_parent(self) -> Cost:
        """Return the bounds in the current context."""
        return Cost(dict(self.context), self.lb, self.ub)
