"""Asynchronous Forward Checking Tree (AFC-tree): AFC-ng on a pseudo-tree.

Complete search for satisfaction. A CPA contains the values along one branch, from the root to its sender. It goes to
the sender's tree children and to lower robots that share a constraint with the sender. All tree children may then
continue at the same time, each in its own subtree. Nogoods contain ancestors only, because all robots in a constraint
are on one branch. `Accept` goes up when a whole subtree has accepted a CPA. Once all children of a root have sent
accepts, the root knows a solution of its component, and sends it to all robots there.

- **When to use**: like AFC-ng, on sparse graphs: branches are searched at the same time.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. Space is polynomial.
- **Parameters**: none.
- **Reference**: Wahbi, Ezzahir, Bessiere, Bouyakhf: "Nogood-based asynchronous forward checking algorithms",
  Constraints 18(3), 2013, Section 4.

The methods beyond AFC-ng (`afc_ng`) have the names of the paper's procedures:

    ProcessAccept `_process_accept`     SolutionDetection `_detect_solution`     BuildPA `_build_pa`

Choices that the paper leaves open, besides those in `afc_ng`:

- The pseudo-tree is induced by the priority order.
- Each connected component has its own root and is searched separately. A component without a solution ends the whole
  search; at quiescence all components are solved.
- An accept identifies the CPA by its counters.

Correctness does not depend on accepts. At quiescence each root has a value. Suppose all ancestors of a robot have
values, each chosen for the current values above it. The CPA of its parent then has the highest counters, so the robot
has accepted it. If the robot had no value left, it would have sent a nogood to an ancestor. No value above has changed
since, so that ancestor had the nogood's value and a compatible view, and has taken another value: a contradiction. So
the robot has a value, chosen for the current values above it. Accepts exist because they inform a root that its
component is solved; they cost at least one message for each robot.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), AFCTree, Concurrent(seed=0)).run()
>>> result.verdict.value, result.witness
('no-solution', 'Robot1.1')
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, assert_never, cast

from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder, PseudoTree
from robochoc.protocols.satisfaction.afc_ng import AFCng
from robochoc.protocols.satisfaction.afc_ng_messages import CPA, Solved
from robochoc.protocols.satisfaction.afc_tree_messages import Accept
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class AFCTree(AFCng):
    """One agent of AFC-tree. State besides that of AFC-ng: `accepts`, the values of each accepting child's subtree."""

    messages: ClassVar[Any] = CPA | Nogood | Accept | Solved
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Wahbi, Ezzahir, Bessiere, Bouyakhf 2013",
        tree=True,
        privacy="constraints of lower robots",
        use_when="as AFC-ng, on sparse graphs: branches search at once",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.accepts: dict[str, Mapping[str, Value]] = {}
        self.parent = self._tree.parents[problem.agent]

    def receive(self, sender: str, message: Message) -> None:
        match cast("CPA | Nogood | Accept | Solved", message):
            case Accept(counters, subtree):
                self._process_accept(sender, counters, subtree)
            case CPA() | Nogood() | Solved() as afc_ng:
                super().receive(sender, afc_ng)
            case never:
                assert_never(never)

    def _process_accept(self, sender: str, counters: Sequence[int], subtree: Mapping[str, Value]) -> None:
        """Store an accept of the current CPA; all other accepts are obsolete."""
        if self.over or self.value is None or counters != [*self.counters, self.counter]:
            return
        self.accepts[sender] = subtree
        self._detect_solution()

    def _assign(self) -> None:
        self.accepts.clear()
        super()._assign()

    def _detect_solution(self) -> None:
        """Once all children have accepted, report the subtree's values to the parent, or to all robots as the root."""
        subtree = self._build_pa()
        if subtree is None:
            return
        if self.parent is None:
            self._stop(subtree)
        else:
            self.send(self.parent, Accept(self.counters, subtree))

    def _build_pa(self) -> dict[str, Value] | None:
        """Return the values of this robot's subtree; None if a child has not accepted yet."""
        if self.value is None or len(self.accepts) < len(self.successors):
            return None
        own = {self.problem.agent: self.problem.values[self.value]}
        return own | {robot: value for subtree in self.accepts.values() for robot, value in subtree.items()}

    def _cpa_order(self) -> tuple[Sequence[str], Mapping[str, int], int]:
        above = self._tree.ancestors(self.problem.agent)[::-1]
        return above, {name: place for place, name in enumerate(above)}, len(above)

    def _successors(self) -> Sequence[str]:
        return self._tree.children[self.problem.agent]

    @property
    def _tree(self) -> PseudoTree:
        if self.order.tree is None:
            raise ValueError("AFC-tree requires an order with a pseudo-tree")
        return self.order.tree
