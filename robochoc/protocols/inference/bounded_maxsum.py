"""Bounded Max-Sum.

Max-Sum on a tree is exact. So the robots cut functions until a tree is left, those on which the least depends, and
solve that. What was cut says how far off the result can be.

- **When to use**: costs, a large team, and a guarantee without a search.
- **Guarantees**: incomplete; linear in messages but for the tree. It tells a lower bound of the optimum: the optimum
  of the tree. The result costs at most the bound plus the weight of all that was cut. Where the graph is a forest,
  nothing is cut, and the result is optimal. A run says `optimal` wherever the result costs no more than the bound. The
  bound holds with hard constraints, too. If one of them is cut, the result may break it, and the weight is infinite:
  then nothing is promised but the bound. A root whose tree costs `inf` proves that there is no solution.
- **Parameters**: none.
- **References**: Rogers, Farinelli, Stranders, Jennings: "Bounded approximate decentralised coordination via the
  max-sum algorithm", Artificial Intelligence 175(2), 2011; for the bound: Rollon, Larrosa: "Improved bounded max-sum
  for distributed constraint optimization", CP 2012.

A function is the sum of all constraints between two robots; the lower of them holds it. The weight of its dependency
on one of them is the largest difference that this robot's value makes. To cut it is to take the least of it over this
robot's values, and leave the rest with the other robot. Of the two dependencies of a function only the lighter one is
ever cut, so the tree is a maximum spanning tree of the robots by these weights. They build it (`spanning`).

Then costs go up the tree, and values down. That is Max-Sum on a tree: R or Q, by who holds the function.

Choices that the paper leaves open, and differences:

- Here costs are minimised. The paper maximises, and replaces a cut function by its worst case; then the assignment's
  own worth is what is told. Here it is the best case, as that alone is a bound of the optimum (Rollon and Larrosa).
- Values go down the tree, each chosen for that above; so ties need no preferences.
- Only between two robots: the paper's functions may have more.

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
    """The sender's function of both robots: its `weight`, and what stays for the receiver if it is cut.

    `weight` is None where there is no function. `rest` is empty where the sender keeps the rest.
    """

    weight: float | None
    rest: list[float]

    act = Act(Performative.INFORM, "the receiver learns how much the function binds both")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        if self.weight is None:
            return f"no function joins me and {words.receiver}"
        return f"without our function, costs are at most {cost_text(self.weight)} off"


class Branch(Message, frozen=True):
    """A lower bound on the cost of the sender's branch.

    `costs` are of the receiver's values, if the sender holds their function (R), and of its own otherwise (Q). `cut`
    is the weight of all that was cut there, `most` what all could add up to.
    """

    costs: list[float]
    cut: float
    most: float

    act = acts.TELL_BOUNDS
    proves_nothing = True  # constraints are cut

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        return f"my branch costs {costs_text(self.costs)}, and up to {cost_text(self.cut)} more"


class Assign(Message, frozen=True):
    """The receiver's value: the best for the value of the sender, who holds their function."""

    value: Value

    act = Act(Performative.REQUEST, "the receiver is to take the value that it is given")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"take {self.value} as your value, {words.receiver}"


class BoundedMaxSum(SpanningProtocol):
    """One agent of bounded Max-Sum.

    `functions` are the own ones, by the robot above that each is shared with. `costs` are those of the own values in
    the own branch of the tree. A root knows `optimum`, the cost of its tree, and `cut`, the weight of all that was cut.
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
        """At a root, a lower bound on the cost of the robots of its tree."""
        return Findings(bound=self.optimum)

    def start(self) -> None:
        """Tell the domain to the holders of the own functions."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.costs = [float(cost) for cost in self.problem.costs({})]
        self._most = _dearest(self.costs)
        for name in self.below:
            self.send(name, Domain(list(self.problem.values)))
        self.stage = self._weigh
        self.settle()

    # What binds two robots, and how much

    def _weigh(self) -> bool:
        """Make the own functions, once the domains above are known, and tell their weights."""
        told = self.heard(self.above)
        if told is None:
            return False
        self._domains = {name: list(one.values) for name, one in told.items() if isinstance(one, Domain)}
        for name, values in self._domains.items():
            for value in values:
                self.problem.refuse_value(name, value)
        for factor in Factor.joined(self.problem.tables(self._domains)):
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
        self.stage = self._hear_weights
        return True

    def _hear_weights(self) -> bool:
        told = self.heard(self.below)
        if told is None:
            return False
        for name, message in told.items():
            if isinstance(message, Dependency) and message.weight is not None:
                if not message.weight >= 0:
                    raise ValueError(f"a function weighs {message.weight}")
                self.weights[name] = message.weight
                self._rests[name] = checked([message.rest], 1, len(self.costs))[0] if message.rest else []
        self.grow()
        return True

    # Costs go up the tree

    def start_in_tree(self) -> None:
        """Count what was cut: its weight where it is held, its rest where that stays."""
        for name, weight in self.weights.items():
            if name not in self.joined:
                self.cut += weight if name in self.functions else 0
                if self._rests[name]:
                    self.costs = total(self.costs, [self._rests[name]])
        self.stage = self._gather

    def _gather(self) -> bool:
        """Take in the branches of the children; tell the own one to the parent, or choose at the root."""
        told = self.heard(self.children)
        if told is None:
            return False
        for name, message in told.items():
            if isinstance(message, Branch):
                self.costs = total(self.costs, [self._least(name, message.costs)])
                self.cut += message.cut
                self._most += message.most
        if self.parent is None:
            self._choose_at_root()
        else:
            self.send(self.parent, Branch(self._for_parent(), self.cut, self._most))
            self.stage = self._hear_value
        return True

    def _least(self, child: str, costs: Row) -> Row:
        """Return what the branch of `child` costs at least, for each own value."""
        table = self.functions.get(child)
        if table is None:
            return checked([costs], 1, len(self.costs))[0]
        self._branches[child] = checked([costs], 1, len(self._domains[child]))[0]
        least: Row = (table.T + self._branches[child]).min(axis=1).tolist()
        return least

    def _for_parent(self) -> Row:
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
        self._take(cheapest(self.costs))

    def _hear_value(self) -> bool:
        told = self.heard([] if self.parent is None else [self.parent])
        if told is None:
            return False
        for name, message in told.items():
            if isinstance(message, Assign):
                self._take(self.problem.values.index(message.value))
            elif isinstance(message, ValueMessage):
                row = self.functions[name][self._domains[name].index(message.value)].tolist()
                self._take(cheapest(total(self.costs, [row])))
        return True

    def _take(self, place: int) -> None:
        """Take a value; tell it to the children, or what they are to take."""
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
    """Return the largest difference that a place on the first axis makes; what is always forbidden makes none."""
    return max(
        (high - low if low < INFINITE else 0)
        for low, high in zip(table.min(axis=0).tolist(), table.max(axis=0).tolist(), strict=True)
    )


def _dearest(costs: Sequence[float]) -> float:
    return max((cost for cost in costs if cost < INFINITE), default=0)
