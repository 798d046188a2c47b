"""Bounded Max-Sum.

Max-Sum is exact on a tree. So the robots cut the functions with the weakest dependencies until a tree is left, and
solve that tree. The weights of the cuts bound the error of the result.

- **When to use**: costs, a large team, and a guarantee without a search.
- **Guarantees**: incomplete; linear in messages except for building the tree. It reports a lower bound on the optimum:
  the optimum of the tree. The result costs at most the bound plus the weight of all cuts. If the graph is a forest,
  nothing is cut, and the result is optimal. A run reports `optimal` if the result costs no more than the bound. The
  bound is valid with hard constraints, too. If a hard constraint is cut, the result may break it, and the weight is
  infinite: then only the bound is guaranteed. A root whose tree costs `inf` proves that there is no solution.
- **Parameters**: none.
- **References**: Rogers, Farinelli, Stranders, Jennings: "Bounded approximate decentralised coordination via the
  max-sum algorithm", Artificial Intelligence 175(2), 2011; for the bound: Rollon, Larrosa: "Improved bounded max-sum
  for distributed constraint optimization", CP 2012.

A function is the sum of all constraints between two robots; the lower of them holds it. The weight of its dependency on
one of them is the largest difference that this robot's value makes. A cut replaces the function by its minimum over
this robot's values, and leaves the rest with the other robot. Only the lighter of a function's two dependencies is ever
cut, so the tree is a maximum spanning tree of the robots by these weights. The robots build this tree themselves
(`spanning`).

Then costs go up the tree, and values go down. That is Max-Sum on a tree: R or Q, depending on which robot holds the
function.

Choices that the paper leaves open, and differences:

- Here costs are minimised. The paper maximises, and replaces a cut function by its worst case; then the reported value
  is that of the assignment. Here it is replaced by its best case, because only the best case gives a bound on the
  optimum (Rollon and Larrosa).
- Values go down the tree, each chosen for the value above; so no preferences are needed to break ties.
- Functions must be between two robots; in the paper they may have more.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), BoundedMaxSum, Concurrent(seed=0)).search()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.findings import Findings
from robochoc.protocols.inference.maxsum_factor import Factor, Row, cheapest, checked, total
from robochoc.protocols.inference.spanning import Choice, Fragment, Heaviest, Merged, NewRoot, SpanningProtocol
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.cycles import Domain
from robochoc.protocols.shared.cycles import Value as ValueMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text, costs_text
from robochoc.solver.exact_costs import check_exact
from robochoc.solver.local_problem import LocalProblem

if TYPE_CHECKING:
    from robochoc.solver.cost_table import Array


class Dependency(Message, frozen=True):
    """The sender's function of both robots: its `weight`, and its rest for the receiver if it is cut.

    `weight` is None if there is no function. `rest` is empty if the sender keeps the rest.
    """

    weight: float | None
    rest: list[float]

    act = Act(Performative.INFORM, "the receiver learns how much the function binds both robots")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        if self.weight is None:
            return f"no function joins me and {words.receiver}"
        return f"without our function, costs are at most {cost_text(self.weight)} off"


class Branch(Message, frozen=True):
    """A lower bound on the cost of the sender's branch.

    `costs` are the costs of the receiver's values if the sender holds their function (R), otherwise of the sender's
    values (Q). `cut` is the weight of all cuts in the branch, `most` the highest possible cost of all functions.
    """

    costs: list[float]
    cut: float
    most: float

    act = acts.TELL_BOUNDS
    proves_nothing = True  # constraints may have been cut

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        return f"my branch costs {costs_text(self.costs)}, and up to {cost_text(self.cut)} more"


class Assign(Message, frozen=True):
    """The receiver's value: the best for the value of the sender, which holds their common function."""

    value: Value

    act = Act(Performative.REQUEST, "the receiver chooses the value in the message")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"take {self.value} as your value, {words.receiver}"


class BoundedMaxSum(SpanningProtocol):
    """One agent of bounded Max-Sum.

    `functions` are this robot's functions, by the robot above that shares each. `costs` are the costs of its values in
    its branch of the tree. A root knows `optimum`, the cost of its tree, and `cut`, the weight of all cuts.
    """

    messages = Domain | Dependency | Fragment | Heaviest | Choice | Merged | NewRoot | Branch | ValueMessage | Assign
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Rogers, Farinelli, Stranders, Jennings 2011",
        complete=False,
        costs=True,
        n_ary=False,
        writes_to_non_neighbours=False,
        tables=True,
        privacy="constraints of others, but for sums",
        use_when="costs, large team: a guarantee without a search",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        place = order.rank[problem.agent]
        self.above = [name for name in problem.neighbours if order.rank[name] < place]
        self.below = [name for name in problem.neighbours if order.rank[name] > place]
        self.functions: dict[str, Array] = {}
        self.costs: Row = []
        self.optimum: float | None = None
        self.cut: float = 0
        self._most: float = 0
        self._domains: dict[str, list[Value]] = {}
        self._rests: dict[str, Row] = {}
        self._branches: dict[str, Row] = {}

    @property
    def findings(self) -> Findings:
        """At a root, a lower bound on the cost of the robots in its tree."""
        return Findings(bound=self.optimum)

    @property
    def most_above_bound(self) -> float | None:
        """At a root, the weight of all cuts in its tree."""
        return None if self.optimum is None else self.cut

    def start(self) -> None:
        """Send the domain to the holders of this robot's functions."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.costs = [float(cost) for cost in self.problem.costs({})]
        self._most = _dearest(self.costs)
        for name in self.below:
            self.send(name, Domain(list(self.problem.values)))
        self.stage = self._send_dependencies
        self.settle()

    # Dependencies and their weights

    def _send_dependencies(self) -> bool:
        """Create this robot's functions, once the domains above are known, and send their weights."""
        messages = self.next_messages(self.above)
        if messages is None:
            return False
        self._domains = {name: list(one.values) for name, one in messages.items() if isinstance(one, Domain)}
        for name, values in self._domains.items():
            for value in values:
                self.problem.refuse_value(name, value)
        for factor in Factor.joined(self.problem.tables(self._domains), of_values=True):
            self.functions[factor.agents[0]] = factor.charges
        for name in self.above:
            table = self.functions.get(name)
            if table is None:
                self.send(name, Dependency(None, []))
                continue
            self._most += _dearest(table.ravel().tolist())
            theirs, mine = _weight(table), _weight(table.T)
            self.weights[name] = min(theirs, mine)
            self._rests[name] = table.min(axis=0 if theirs <= mine else 1).tolist()
            self.send(name, Dependency(min(theirs, mine), [] if theirs <= mine else self._rests[name]))
            if theirs > mine:
                self._rests[name] = []
        self.stage = self._receive_dependencies
        return True

    def _receive_dependencies(self) -> bool:
        messages = self.next_messages(self.below)
        if messages is None:
            return False
        for name, message in messages.items():
            if isinstance(message, Dependency) and message.weight is not None:
                if not message.weight >= 0:
                    raise ValueError(f"{name} sent a function of weight {message.weight}; it must be 0 or more")
                self.weights[name] = message.weight
                self._rests[name] = checked([message.rest], 1, len(self.costs))[0] if message.rest else []
        self.start_spanning()
        return True

    # Costs go up the tree

    def start_in_tree(self) -> None:
        """Add up the cuts: the weight at the robot that holds a function, the rest at the robot that keeps it."""
        for name, weight in self.weights.items():
            if name not in self.joined:
                self.cut += weight if name in self.functions else 0
                if self._rests[name]:
                    self.costs = total(self.costs, [self._rests[name]])
        self.stage = self._receive_branches

    def _receive_branches(self) -> bool:
        """Add the children's branches; send this robot's branch to the parent, or choose at the root."""
        messages = self.next_messages(self.children)
        if messages is None:
            return False
        for name, message in messages.items():
            if isinstance(message, Branch):
                self.costs = total(self.costs, [self._least(name, message.costs)])
                self.cut += message.cut
                self._most += message.most
        if self.parent is None:
            self._choose_at_root()
        else:
            self.send(self.parent, Branch(self._costs_for_parent(), self.cut, self._most))
            self.stage = self._receive_value
        return True

    def _least(self, child: str, costs: Row) -> Row:
        """Return the least cost of the branch of `child`, for each of this robot's values."""
        table = self.functions.get(child)
        if table is None:
            return checked([costs], 1, len(self.costs))[0]
        self._branches[child] = checked([costs], 1, len(self._domains[child]))[0]
        least: Row = (table.T + self._branches[child]).min(axis=1).tolist()
        return least

    def _costs_for_parent(self) -> Row:
        table = self.functions.get(self.parent or "")
        if table is None:
            return self.costs
        least: Row = (table + self.costs).min(axis=1).tolist()
        return least

    # Values go down

    def _choose_at_root(self) -> None:
        check_exact(self._most)
        least = min(self.costs)
        if least == INFINITE:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.optimum = int(least)
        self._choose_value(cheapest(self.costs))

    def _receive_value(self) -> bool:
        messages = self.next_messages([] if self.parent is None else [self.parent])
        if messages is None:
            return False
        for name, message in messages.items():
            if isinstance(message, Assign):
                self._choose_value(self.problem.values.index(message.value))
            elif isinstance(message, ValueMessage):
                row = self.functions[name][self._domains[name].index(message.value)].tolist()
                self._choose_value(cheapest(total(self.costs, [row])))
        return True

    def _choose_value(self, place: int) -> None:
        """Choose a value; send the children this value, or the values that they must choose."""
        self.value = place
        for child in self.children:
            table = self.functions.get(child)
            if table is None:
                self.send(child, ValueMessage(self.problem.values[place]))
            else:
                best = cheapest((table[:, place] + self._branches[child]).tolist())
                self.send(child, Assign(self._domains[child][best]))
        self.stage = None


def _weight(table: Array) -> float:
    """Return the largest difference that an index on the first axis makes; forbidden combinations make none."""
    return max(
        (high - low if low < INFINITE else 0)
        for low, high in zip(table.min(axis=0).tolist(), table.max(axis=0).tolist(), strict=True)
    )


def _dearest(costs: Sequence[float]) -> float:
    return max((cost for cost in costs if cost < INFINITE), default=0)
