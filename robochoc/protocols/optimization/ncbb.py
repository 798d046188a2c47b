"""No-Commitment Branch and Bound (NCBB).

Complete search for minimum cost on a pseudo-tree, in linear memory. First a greedy assignment gives an upper bound.
Then each robot has the subtrees of its children searched for its values, one after the other. It does not commit to a
value: different subtrees may be searched for different values at the same time, each by increasing lower bound. The
bounds come from those robots in the subtree with which it shares constraints: it asks them before it searches for a
value.

- **When to use**: costs, a pseudo-tree with branches, little memory.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Each robot
  remembers a bound and an assignment for each child and value. On a connected team, an answer is known early.
- **Parameters**: none.
- **Reference**: Chechetka, Sycara: "No-commitment branch and bound search for distributed constraint optimization",
  AAMAS 2006.

The messages have other names if one name has two meanings in the paper:

    VALUE (first phase)    `Greedy`     VALUE (search)   `Request`     SEARCH   `Search`
    COST (of a subtree)    `Result`     COST (a bound)   `Report`      STOP     `Terminate`

The framework of the search is in `branching`, the bounds are in `forward_bounding`; PT-FB uses both, too.

Choices that the paper leaves open, and differences:

- Constraints may be n-ary: the lowest robot in the scope pays them. There may be several trees.
- A robot sends the requester its total bound, with the values of all robots from the requester up. In the paper it
  sends only the part that depends on the requester's value. The total bound is also valid, and it is higher.
- The greedy assignment is remembered, and its cost is the first bound: only cheaper assignments are searched for.
- Results contain the best assignment of the subtree. In the paper, the last search is repeated to find it.
- A leaf answers its parent with its cost and value, so it is never asked to search.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), NCBB, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, assert_never, cast

from robochoc.model.problem import INFINITE
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import Proof, Reception, can_take
from robochoc.protocols.findings import Incumbent
from robochoc.protocols.message import Message, Value
from robochoc.protocols.optimization.branching import (
    Assignment,
    Members,
    Number,
    Report,
    Request,
    Result,
    Terminate,
    allowance,
)
from robochoc.protocols.optimization.forward_bounding import ForwardBoundingProtocol
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


class Greedy(Message, frozen=True):
    """The sender's value in the greedy assignment of the first phase (VALUE)."""

    value: Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} in the first assignment"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [can_take(reception.sender, self.value)]


class Search(Message, frozen=True):
    """A request to search the receiver's subtree for a cost below `bound`, with the values sent before (SEARCH)."""

    bound: Number

    act = Act(Performative.REQUEST, "the receiver must search its subtree")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"search your subtree {allowance(self.bound)}"


@mypyc_attr(allow_interpreted_subclasses=True)
class NCBB(ForwardBoundingProtocol):
    """One agent of NCBB. State besides the search: `greedy_view`, and the `greedy` results of the children."""

    messages: ClassVar[Any] = TreeMessage | Members | Greedy | Request | Report | Search | Result | Terminate
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Chechetka & Sycara 2006",
        costs=True,
        upper_bound=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints among others",
        use_when="costs, sparse graph, little memory, an answer early",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.greedy_view: dict[str, Value] = {}
        self.greedy: dict[str, Result] = {}
        self.greedy_cost: Number = INFINITE
        self.greedy_values: Assignment = {}
        self._first_phase = True

    def start_in_tree(self) -> None:
        """Send the parent the links between the subtree and the robots above."""
        super().start_in_tree()
        self._choose_greedily()

    def begin_search(self) -> None:
        """Do nothing: the root begins with the first phase, whose results arrive after the `Members` messages."""

    def handle(self, sender: str, message: Message) -> None:
        match cast("Members | Greedy | Request | Report | Search | Result | Terminate", message):
            case Members(linked):
                self.store_members(sender, linked)
            case Greedy(value):
                self.greedy_view[sender] = value
                self._choose_greedily()
            case Request(value):
                self.answer_request(sender, value)
            case Report(bound):
                self.store_report(sender, bound)
            case Search(bound):
                self._search(bound)
            case Result() as result if self._first_phase:
                self._store_greedy_result(sender, result)
            case Result() as result:
                self.store_result(sender, result)
            case Terminate(values):
                self.finish(values)
            case never:
                assert_never(never)

    # The first phase

    def _choose_greedily(self) -> None:
        """Choose the cheapest value once all values above are known, and send it to all robots below."""
        if len(self.greedy_view) < len(self.ancestors):
            return
        self.local = self.problem.costs(self.greedy_view)
        self.value = self.cheapest
        for name in self.descendants:
            self.send(name, Greedy(self.problem.values[self.value]))
        if not self.children:
            self._add_up()

    def _store_greedy_result(self, child: str, result: Result) -> None:
        if child not in self.children or child in self.greedy:
            raise ValueError(f"unexpected or repeated cost from {child}")
        self.greedy[child] = result
        if result.cost < INFINITE:
            self.store_subtree(child, result)
        if len(self.greedy) == len(self.children):
            self._add_up()

    def _add_up(self) -> None:
        """Send the parent the cost of the first assignment; the root begins the search with this cost as bound."""
        self._first_phase = False
        cost = sum([result.cost for result in self.greedy.values()], self.local[self.cheapest])
        values: Assignment = {}
        if cost < INFINITE:
            values = {self.problem.agent: self.problem.values[self.cheapest]}
            for result in self.greedy.values():
                values.update(result.values)
        self.greedy.clear()
        if self.parent is not None:
            self.send(self.parent, Result(cost, values))
            return
        if cost < self.problem.upper_bound:
            self.greedy_cost, self.greedy_values = cost, values
        self.search(cost, self.problem.charges)

    # The search

    def explore(self, child: str, limit: Number) -> None:
        """Send a bound to `child` (SEARCH)."""
        self.send(child, Search(limit))

    def _search(self, bound: Number) -> None:
        if self.parent not in self.above.totals or self.searching:
            raise ValueError(f"{self.problem.agent} does not know the value of its parent, or is already searching")
        self.search(bound, self.above.totals[self.parent])

    def end_search(self, cost: Number, solution: Assignment) -> None:
        """End the search, as the root: with the first assignment if no cheaper one was found."""
        if cost < self.greedy_cost:
            super().end_search(cost, solution)
        else:
            super().end_search(self.greedy_cost, self.greedy_values)

    @property
    def incumbent(self) -> Incumbent | None:
        """The cheapest assignment that this root knows, if it contains all robots."""
        cheaper = super().incumbent
        if cheaper is not None or len(self.greedy_values) < len(self.order.names):
            return cheaper
        return Incumbent(self.greedy_cost, self.greedy_values)
