"""Asymmetric Pseudo-tree Forward Bounding (AsymPT-FB).

PT-FB for asymmetric costs: each robot in a constraint pays its own part, which no other robot knows. The bounds that
robots in a subtree report cover their own sides only. Before a robot has its subtree searched, it asks all robots above
with which it shares a constraint for the costs of their sides with each of its values. It stores the answers: they
apply whenever that robot has the same value, and are part of its bounds from then on.

- **When to use**: asymmetric costs, a pseudo-tree with branches.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. In addition to
  PT-FB's state, a robot stores at most all costs of the other sides of its constraints.
- **Parameters**: none.
- **Reference**: Litov, Meisels: "Forward bounding on pseudo-trees for DCOPs and ADCOPs", AIJ 252, 2017 (AsymPT-FB).

The methods, in addition to those of PT-FB (`pt_fb.py`):

    ask robots above for their sides   `search_subtree`     their answers   `_send_row`     add them    `_add_row`

Information disclosed: as in PT-FB, with bounds on single sides; and, for each value that a robot has while its subtree
searches, the costs of its side for all values of a robot below, minus their minimum. In its part towards a robot below,
a robot uses only the least entry for each of its values, and the rows for values that it takes.

Choices that the paper leaves open, and differences:

- A robot asks about all its values in one request, with one request for each value of the robot above.
- A robot's costs contain, from the beginning, the least costs of its own parts with robots below. Its answers are the
  costs of its side in excess of these.
- Totally known constraints are paid by the robot in the scope that is lowest in the tree, as in PT-FB; they may be
  n-ary.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.random_csp import random_csp
>>> team = random_csp(5, 3, 0.6, 0, max_cost=9, asymmetric=True)
>>> result = Simulation(team, AsymPTFB, Concurrent(seed=0)).run()
>>> result.verdict.value, result.assignments["Robot1"]
('solution', {'V1': 1})
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import assert_never, cast

from robochoc.model.problem import INFINITE
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.message import Message, Value
from robochoc.protocols.optimization.branching import Members, Number, Report, Request, Result, Terminate
from robochoc.protocols.optimization.forward_bounding import CostsAbove
from robochoc.protocols.optimization.pt_fb import CPA, PTFB, Reduce
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, costs_text
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted


class RowRequest(Message, frozen=True):
    """A request for the costs of the receiver's side, with its value, for each of the sender's `values`."""

    values: list[Value]

    act = Act(Performative.QUERY_REF, "the sender asks for the costs of the receiver's side with each of its values")

    def in_words(self, _: Wording) -> str:
        return f"what does your side add for each of my {counted(len(self.values), 'value')}?"


class Row(Message, frozen=True):
    """For each value of the receiver, the cost of the sender's side beyond the cost that the sender counts."""

    costs: list[Number]

    act = Act(Performative.INFORM, "the answer to `RowRequest`")

    def in_words(self, _: Wording) -> str:
        return f"for your values my side adds {costs_text(self.costs)}"


class CostsOfBothSides(CostsAbove):
    """The costs of this robot's values with robots above, including these robots' sides as far as received."""

    def __init__(self, problem: LocalProblem) -> None:
        super().__init__(problem)
        self._rows: dict[tuple[str, Value], Sequence[Number]] = {}

    def knows(self, name: str) -> bool:
        """Return whether the side of `name` for its present value is known."""
        return (name, self.values[name]) in self._rows

    def add_side(self, name: str, row: Sequence[Number]) -> None:
        """Add the side of `name` with its present value to the costs, for it and all robots below it."""
        self._rows[name, self.values[name]] = row
        names = [*self.values]
        for lower in names[names.index(name) :]:
            self.totals[lower] = [cost + more for cost, more in zip(self.totals[lower], row, strict=True)]

    def added(self, name: str, view: Mapping[str, Value]) -> Sequence[Number]:
        """Return the additional cost of each value with the value of `name`, including its side if it is known."""
        own = super().added(name, view)
        row = self._rows.get((name, view[name]))
        return own if row is None else [cost + more for cost, more in zip(own, row, strict=True)]


class AsymPTFB(PTFB):
    """One agent of AsymPT-FB.

    State besides that of PT-FB:

    - `least`: for each robot below that shares a constraint, the least cost of each value in this robot's parts.
    - `asking`: robots above that have not sent their sides yet; the search begins after them. None: no search waits.
    """

    messages = TreeMessage | Members | Request | Report | CPA | Reduce | Result | Terminate | RowRequest | Row
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Litov & Meisels 2017",
        costs=True,
        upper_bound=True,
        partially_known=True,
        asymmetric=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="parts of PKC but for rows that are asked for, and bounds",
        use_when="asymmetric costs, pseudo-tree with branches",
    )
    above: CostsOfBothSides

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.least: dict[str, list[Number]] = {}
        self.asking: set[str] | None = None

    def costs_above(self) -> CostsOfBothSides:
        """Return the costs of this robot with robots above, which store the sides received."""
        return CostsOfBothSides(self.problem)

    def start_in_tree(self) -> None:
        """Compute the least costs of this robot's sides; then begin as in PT-FB."""
        self.least = {name: self.problem.least_side(name) for name in self.descendants}
        self.above.alone = [sum(costs) for costs in zip(self.problem.charges, *self.least.values(), strict=True)]
        super().start_in_tree()

    def handle(self, sender: str, message: Message) -> None:
        match cast("Members | Request | Report | CPA | Reduce | Result | Terminate | RowRequest | Row", message):
            case RowRequest(values):
                self._send_row(sender, values)
            case Row(costs):
                self._add_row(sender, costs)
            case Reduce(bound) if self.asking is not None:
                self.limit = min(self.limit, bound)
            case Members() | Request() | Report() | CPA() | Reduce() | Result() | Terminate():
                super().handle(sender, message)
            case never:
                assert_never(never)

    # Robots above

    @property
    def _unknown(self) -> list[str]:
        """The robots above that may have a side, and have not sent it for their present value.

        A robot knows which of its parents have a side; a child may have a side unknown to it.
        """
        may = {*self.problem.pkc_parents, *self.problem.children}
        return [name for name in self.ancestors if name in may and not self.above.knows(name)]

    def knows_cost(self, sender: str) -> bool:
        """Return whether this is a leaf that knows all sides above."""
        return super().knows_cost(sender) and not self._unknown

    def search_subtree(self, bound: Number) -> None:
        """Ask the robots above for their sides; search once all sides are known."""
        if self.asking is not None:
            raise ValueError(f"{self.problem.agent} is already asking for sides")
        self.limit, self.asking = bound, {*self._unknown}
        for name in self._unknown:
            self.send(name, RowRequest([*self.problem.values]))
        self._search_if_all_is_known()

    def _add_row(self, sender: str, costs: list[Number]) -> None:
        """Add the side of a robot above."""
        if not self.asking or sender not in self.asking or len(costs) != len(self.problem.values):
            raise ValueError(f"{sender} sent costs that {self.problem.agent} did not request")
        self.asking.remove(sender)
        self.above.add_side(sender, costs)
        self._search_if_all_is_known()

    def _search_if_all_is_known(self) -> None:
        if not self.asking:
            self.asking = None
            super().search_subtree(self.limit)

    # Robots below

    def _send_row(self, sender: str, values: Sequence[Value]) -> None:
        """Send a robot below the costs of this robot's side for each of its values, in excess of the costs counted."""
        index = self.present(self.child_above(sender))
        self.send(sender, Row([self._side(index, sender, value) for value in values]))

    def _side(self, index: int, robot: str, value: Value) -> Number:
        broken, cost = self.problem.own_side(index, robot, value)
        return INFINITE if broken else cost - self.least[robot][index]
