"""Branch-and-Bound ADOPT (BnB-ADOPT+).

Complete search for minimum cost on a pseudo-tree: ADOPT's messages and bounds, with depth-first branch and bound
instead of best-first search. A robot keeps its value until LB(d) reaches the cost of the best known complete solution
(UB), or its threshold (TH). It sends far fewer messages than ADOPT, as it does not return to the same values again and
again.

- **When to use**: costs, a sparse graph, little memory.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution.
- **Parameters (`--set`)**: `heuristic`. With `dp`, children first say what their subtrees cost at least for each value
  of their parent (two messages a robot), and lower bounds begin there; with `none` (default) they begin at 0.
- **References**: Yeoh, Felner, Koenig: "BnB-ADOPT: an asynchronous branch-and-bound DCOP algorithm", JAIR 38, 2010,
  Section 4; for redundant messages: Gutierrez, Meseguer: "Saving redundant messages in BnB-ADOPT", AAAI 2010;
  for the heuristic: Ali, Koenig, Tambe: "Preprocessing techniques for accelerating the DCOP algorithm ADOPT", AAMAS
  2005.

The methods have the names of the procedures:

    Start          `begin`                 InitSelf        `_merge`, `_choose`
    When Received  `handle`                InitChild       `forget` (in `bounding`, as the next ones)
    Backtrack      `decide`, `act`         PriorityMerge   `merge`
                                           Compatible      `agrees`

Choices that the papers leave open, and differences:

- Constraints may be n-ary, and there may be several trees (see `adopt`, also for hard constraints and unknown values
  of neighbours above).
- Heuristic values h of a child count what it pays with its parent, and the h of its own children; what it pays with
  others above is left out. A robot begins once it has those of all its children.
- A context grows as values become known; there is no initial value that all robots know. A value that was unknown
  before does not invalidate the threshold.
- Bounds are computed when the inbox has been drained, also for InitSelf. The ID grows when the value changes. SCP of a
  child contains the robots that its contexts have named.
- A value is repeated only to a child that requests its threshold after InitSelf dropped it (ThReq). A lower threshold
  alone is not sent. A higher one is, even with the same value: otherwise the child would wait for its parent, and its
  parent for the child.
- When UB <= LB, the robot takes the value with the least UB, as another one with the same LB may cost more.
- Terminate contains the final values above. The search of the subtree continues with these, without a threshold, until
  UB <= LB there, too: since the parent's bounds were computed, the robot may have taken other values in other
  contexts. Before it sends Terminate, a robot sends its final value to all neighbours below, as robots further down
  may need it.

Termination: at quiescence all robots have terminated. Otherwise there is a highest robot that has not; its TH is
infinite, and UB > LB. All contexts agree, so LB(d) < UB for its value d, and for some child lb < ub and lb < TH of the
child. By the child's last message, LB < UB there, and LB < TH; so LB(d) < min(TH, UB) for its value d, and so on, down
to a leaf, where LB = UB: a contradiction.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), BnBADOPT, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from typing import Any, ClassVar, assert_never, cast

import msgspec

from robochoc.model import message
from robochoc.model.message import Message
from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.bounding import BoundingProtocol
from robochoc.protocols.optimization.messages.bnb_adopt import Cost, Domain, Floor, Value
from robochoc.protocols.optimization.messages.bounding import Context, Number, Terminate
from robochoc.protocols.optimization.settings.bnb_adopt import BnBADOPTSettings
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.compiled import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class BnBADOPT(BoundingProtocol):
    """One agent of BnB-ADOPT+. State besides the bounds: `threshold` (TH).

    `sent_values` are the last Values sent to each child, `sent_cost` the last Cost, without its request.
    `floors`: for each own value, what the subtree of each child costs at least in any context (h).
    """

    messages: ClassVar[Any] = TreeMessage | Value | Cost | Domain | Floor | Terminate
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Yeoh, Felner, Koenig 2010; Gutierrez & Meseguer 2010",
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="costs, sparse graph, little memory",
    )

    settings: ClassVar[BnBADOPTSettings] = BnBADOPTSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.threshold: Number = INFINITE
        self.threshold_request = False
        self.sent_values: dict[str, Value] = {}
        self.sent_cost: Cost | None = None
        self.floors: dict[str, list[Number]] = {}
        self._moved = False
        self._parent_values: list[message.Value] | None = None

    def begin(self) -> None:
        """Initialise the bounds, and ask the children for their floors."""
        super().begin()
        if self.settings.heuristic == "dp":
            for child in self.children:
                self.send(child, Domain(list(self.problem.values)))

    def decide(self) -> None:
        """Compute the bounds and act, unless floors of children are still to come."""
        if self.settings.heuristic == "none" or len(self.floors) == len(self.children):
            super().decide()

    def handle(self, sender: str, message: Message) -> None:
        """Dispatch on the message's type."""
        if self.terminated:
            return
        match cast("Value | Cost | Domain | Floor | Terminate", message):
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
            case Domain(values):
                self._take_domain(sender, values)
            case Floor(costs):
                self.take_floor(sender, costs)
            case Terminate(context):
                self._merge(context)
                self.threshold = INFINITE
                self.last_values = True
            case never:
                assert_never(never)

    # Floors

    def _take_domain(self, sender: str, values: list[message.Value]) -> None:
        """Note the values of the parent."""
        if sender != self.parent or self._parent_values is not None or not values:
            raise ValueError(f"{sender} has no values to tell")
        for value in values:
            self.problem.refuse_value(sender, value)
        self._parent_values = values
        self._tell_floor()

    def take_floor(self, child: str, costs: list[Number]) -> None:
        """Raise the lower bounds of `child` to what its subtree costs at least."""
        if child not in self.bounds or child in self.floors or len(costs) != len(self.problem.values):
            raise ValueError(f"{child} has no floor to tell")
        self.floors[child] = costs
        bounds = self.bounds[child]
        bounds.lb = [max(pair) for pair in zip(bounds.lb, costs, strict=True)]
        self._moved = True
        self._tell_floor()

    def _tell_floor(self) -> None:
        """Tell the parent the floor, once the parent's values and all children's floors are known."""
        if self.parent is None or self._parent_values is None or len(self.floors) < len(self.children):
            return
        below = [sum(costs) for costs in zip(*self.floors.values(), strict=True)] or [0] * len(self.problem.values)
        floor: list[Number] = []
        for value in self._parent_values:
            paid = self.problem.costs({self.parent: value})
            floor.append(min(own + others for own, others in zip(paid, below, strict=True)))
        self.send(self.parent, Floor(floor))

    def forget(self, child: str) -> None:
        """Drop the bounds of `child`, down to its floor."""
        super().forget(child)
        floor = self.floors.get(child)
        if floor is not None:
            self.bounds[child].lb = [*floor]

    # Contexts and thresholds

    def _merge(self, context: Context) -> None:
        """Merge a context; if it changed, choose the value again and reset TH (InitSelf)."""
        news, changed = self.merge(context)
        self._moved = self._moved or bool(news)
        if changed:
            self.drop_threshold()

    def drop_threshold(self) -> None:
        """Forget the threshold, which was for another context, and request it."""
        self.threshold = INFINITE
        self.threshold_request = True

    def act(self) -> None:
        """Choose a value and send values and costs that changed (Backtrack)."""
        self._choose()
        self.tell_values()
        for name in self.pseudo_children:
            self.tell(name, self.value_for(name))
        if self.settled and self.may_end:
            self.terminate()
        elif not self.may_end:
            self._tell_cost()

    def _choose(self) -> None:
        if self.settled:
            self.take(self.cheapest(self.upper))
        elif self._moved or self.leaves:
            self.take(self.cheapest(self.lower))
        self._moved = False

    @property
    def settled(self) -> bool:
        """Whether the value with the least upper bound is good enough."""
        return self.ub <= self.lb

    @property
    def leaves(self) -> bool:
        """Whether the own value is to be left: its lower bound reaches UB or TH."""
        return self.lower[self.index] >= min(self.threshold, self.ub)

    # What is said

    def tell_values(self) -> None:
        """Send the children what changed."""
        for child in self.children:
            self._tell_value(child)

    def _tell_value(self, child: str) -> None:
        """Send `child` a new value, a higher threshold, or a threshold that it requested."""
        value, last = self.value_for(child), self.sent_values.get(child)
        if last is None or self.is_news(value, last):
            self.sent_values[child] = value
            self.send(child, value)

    def value_for(self, name: str) -> Value:
        """Return the own value, and the threshold of `name` if it is a child."""
        return Value(*self.own, self.share(name) if name in self.bounds else INFINITE)

    def is_news(self, value: Value, last: Value) -> bool:
        """Return whether a child that was told `last` has to be told `value`."""
        return last.counter < value.counter or last.threshold < value.threshold

    def share(self, child: str) -> Number:
        """Return the part of the threshold left for `child` if other children cost their lower bounds."""
        limit = min(self.threshold, self.ub)
        if limit == INFINITE:
            return INFINITE
        others = sum(bounds.lb[self.index] for name, bounds in self.bounds.items() if name != child)
        return max(0, limit - self.delta[self.index] - others)

    def _tell_cost(self) -> None:
        """Send the parent new bounds, bounds in a new context, or a request for the threshold."""
        cost = Cost(dict(self.context), self.lb, self.ub)
        if self.parent is not None and (self.threshold_request or cost != self.sent_cost):
            self.sent_cost = cost
            self.send(self.parent, msgspec.structs.replace(cost, threshold_request=self.threshold_request))
            self.threshold_request = False
