"""Branch-and-Bound ADOPT (BnB-ADOPT+).

Complete search for minimum cost on a pseudo-tree, with the messages and bounds of ADOPT, but depth-first branch and
bound instead of best-first search. A robot keeps its value until LB(d) reaches the cost of the best known complete
solution (UB), or its threshold (TH). It sends far fewer messages than ADOPT, because it does not return to the same
values repeatedly.

- **When to use**: costs, a sparse graph, little memory.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution.
- **Parameters (`--set`)**: `heuristic`. With `dp`, children first send lower bounds on the costs of their subtrees for
  each value of their parent (two messages for each robot); with `none` (default) lower bounds are 0 at first.
- **References**: Yeoh, Felner, Koenig: "BnB-ADOPT: an asynchronous branch-and-bound DCOP algorithm", JAIR 38, 2010,
  Section 4; for redundant messages: Gutierrez, Meseguer: "Saving redundant messages in BnB-ADOPT", AAAI 2010;
  for the heuristic: Ali, Koenig, Tambe: "Preprocessing techniques for accelerating the DCOP algorithm ADOPT", AAMAS
  2005.

The methods have the names of the paper's procedures; some of them are in `depth_first`:

    Start          `start_in_tree`                 InitSelf        `_merge`, `_choose`
    When Received  `handle`                InitChild       `forget` (in `bounding`, as the next ones)
    Backtrack      `decide`, `act`         PriorityMerge   `merge`
                                           Compatible      `agrees`

Choices that the papers leave open, and differences:

- Constraints may be n-ary, and there may be several trees (see `adopt`, also for hard constraints and unknown values
  of neighbours above).
- Heuristic values h of a child include its costs with its parent, and the h of its own children, but not its costs with
  other robots above. A robot begins once it has received the floors from all its children.
- A context grows as values become known; there is no initial value that all robots know. A value that was unknown
  before does not invalidate the threshold.
- Bounds are computed when the inbox has been drained, also for InitSelf. The ID grows when the value changes. SCP of a
  child contains the robots that its contexts have mentioned.
- A value is repeated only to a child that requests its threshold after InitSelf dropped it (ThReq). A lower threshold
  alone is not sent. A higher threshold is sent even with the same value: otherwise the child would wait for its parent,
  and the parent for its child.
- When UB <= LB, the robot takes the value with the least UB, because another value with the same LB may cost more.
- Terminate contains the final values above. The search of the subtree continues with these values, without a threshold,
  until UB <= LB holds there, too: since the parent's bounds were computed, the robot may have taken other values in
  other contexts. Before it sends Terminate, a robot sends its final value to all neighbours below, because robots
  further down may need it.

Termination: at quiescence all robots have terminated. Otherwise there is a highest robot that has not; its TH is
infinite, and UB > LB. All contexts agree, so LB(d) < UB for its value d, and for some child lb < ub and lb < TH of the
child. By the child's last message, LB < UB at the child, and LB < TH; so LB(d) < min(TH, UB) for its value d. The
argument repeats down to a leaf, where LB = UB: a contradiction.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), BnBADOPT, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from typing import Any, ClassVar, cast

from robochoc.protocols import message
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.bnb_adopt_messages import BnBADOPTSettings, Cost, Domain, Floor, Value
from robochoc.protocols.optimization.bounding_messages import Number, Terminate
from robochoc.protocols.optimization.depth_first import DepthFirstProtocol
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class BnBADOPT(DepthFirstProtocol):
    """One agent of BnB-ADOPT+. State besides that of the search (`depth_first`): `floors`.

    A floor is, for each value of this robot, the least cost of a child's subtree in any context (h).
    """

    messages: ClassVar[Any] = TreeMessage | Value | Cost | Domain | Floor | Terminate
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Yeoh, Felner, Koenig 2010; Gutierrez & Meseguer 2010",
        costs=True,
        upper_bound=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="costs, sparse graph, little memory",
    )

    settings: ClassVar[BnBADOPTSettings] = BnBADOPTSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.floors: dict[str, list[Number]] = {}
        self._parent_values: list[message.Value] | None = None

    def start_in_tree(self) -> None:
        """Initialise the bounds, and ask the children for their floors."""
        super().start_in_tree()
        if self.settings.heuristic == "dp":
            for child in self.children:
                self.send(child, Domain(list(self.problem.values)))

    def decide(self) -> None:
        """Compute the bounds and act, unless floors from children are still missing."""
        if self.settings.heuristic == "none" or len(self.floors) == len(self.children):
            super().decide()

    def handle(self, sender: str, message: Message) -> None:
        match cast("Value | Cost | Domain | Floor | Terminate", message):
            case Domain(values):
                self._store_domain(sender, values)
            case Floor(costs):
                self.raise_floor(sender, costs)
            case _:
                super().handle(sender, message)

    # Floors

    def _store_domain(self, sender: str, values: list[message.Value]) -> None:
        """Store the values of the parent."""
        if sender != self.parent or self._parent_values is not None or not values:
            raise ValueError(f"unexpected values from {sender}")
        for value in values:
            self.problem.refuse_value(sender, value)
        self._parent_values = values
        self._send_floor()

    def raise_floor(self, child: str, costs: list[Number]) -> None:
        """Raise the lower bounds on `child` to the least costs of its subtree."""
        if child not in self.bounds or child in self.floors or len(costs) != len(self.problem.values):
            raise ValueError(f"unexpected or repeated floor from {child}")
        self.floors[child] = costs
        bounds = self.bounds[child]
        bounds.lb = [max(pair) for pair in zip(bounds.lb, costs, strict=True)]
        self._moved = True
        self._send_floor()

    def _send_floor(self) -> None:
        """Send the parent the floor, once the parent's values and all children's floors are known."""
        if self.parent is None or self._parent_values is None or len(self.floors) < len(self.children):
            return
        below = [sum(costs) for costs in zip(*self.floors.values(), strict=True)] or [0] * len(self.problem.values)
        floor: list[Number] = []
        for value in self._parent_values:
            paid = self.problem.costs({self.parent: value})
            floor.append(min(own + others for own, others in zip(paid, below, strict=True)))
        self.send(self.parent, Floor(floor))

    def forget(self, child: str) -> None:
        """Drop the bounds on `child`, down to its floor."""
        super().forget(child)
        floor = self.floors.get(child)
        if floor is not None:
            self.bounds[child].lb = [*floor]
