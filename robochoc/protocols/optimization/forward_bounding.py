"""The common base of NCBB and PT-FB: before a subtree is searched for a value, its robots are asked for bounds.

A robot asks all robots of the subtree with which it shares a constraint. Each answers with the least cost of its values
with the values of the requester and of robots above it. It ignores robots *below* the requester: their last values are
from an earlier search. So it must know the order of the robots above, which it learns from the order of the first
requests: a robot lets a subtree search only when all its linked robots there have answered.

At the beginning each robot tells its parent, for each robot above, which robots in its subtree share a constraint with
that robot (`Members`). A leaf answers its parent with the cost itself and its value, because all constraints of a leaf
are with robots above.

A constraint belongs to its lowest robot, which pays it: constraints may be n-ary. It is checked when the last of the
other robots asks. Costs with robots above that robot are known from the requests of those robots.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence

from robochoc.model.problem import INFINITE
from robochoc.protocols.message import Value
from robochoc.protocols.optimization.branching import BranchingProtocol, Members, Number, Report, Request, Result
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class CostsAbove:
    """The costs of this robot's values with the robots above, which ask one after the other, the highest first.

    `values` are the values of the robots that have asked. `totals` contains, for each of them, the cost of every value
    of this robot with its value and the values of robots above it.
    """

    def __init__(self, problem: LocalProblem) -> None:
        self._problem = problem
        self.alone: Sequence[Number] = problem.charges
        """The cost of each value of this robot that does not depend on robots above."""
        self.values: dict[str, Value] = {}
        self.totals: dict[str, Sequence[Number]] = {}

    def ask(self, name: str, value: Value) -> Sequence[Number]:
        """Return the costs after `name` has taken `value`."""
        self.values[name] = value
        names = [*self.values]
        place = names.index(name)
        view = {above: self.values[above] for above in names[: place + 1]}
        base = self.totals[names[place - 1]] if place else self.alone
        added = self.added(name, view)
        self.totals[name] = [cost + more for cost, more in zip(base, added, strict=True)]
        return self.totals[name]

    def added(self, name: str, view: Mapping[str, Value]) -> Sequence[Number]:
        """Return the additional cost of each value with the value of `name`, which is below all others in `view`."""
        return self._problem.added_by(name, view)


@mypyc_attr(allow_interpreted_subclasses=True)
class ForwardBoundingProtocol(BranchingProtocol):
    """One agent that asks for bounds.

    - `asked`: for each child, the robots in its subtree that share a constraint with this one. `members`: these robots,
      and those that share a constraint with robots above this one.
    - `handed`: lower bounds on the costs of single robots in this robot's subtree, with the values above it.
    - `answers`: the same bounds with the value that is searched, from robots that were asked.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.asked: dict[str, list[str]] = {}
        self.members: dict[str, list[str]] = {}
        self.above = self.costs_above()
        self.handed: dict[str, Number] = {}
        self.answers: dict[str, Number] = {}
        self._linked: dict[str, list[str]] = {}
        self._child_above: dict[str, str] = {}
        self._waiting: dict[str, set[str]] = {}

    def costs_above(self) -> CostsAbove:
        """Return the costs of this robot with robots above; overridden in subclasses that know more costs."""
        return CostsAbove(self.problem)

    def start_in_tree(self) -> None:
        """Send the parent the links between the subtree and the robots above, once all children have done the same."""
        self._linked = {name: [self.problem.agent] for name in self.ancestors}
        self._send_members()

    @abstractmethod
    def begin_search(self) -> None:
        """Begin, as the root, after all robots know the members of their subtrees."""

    def store_members(self, child: str, linked: Mapping[str, Sequence[str]]) -> None:
        """Store which robots in the child's subtree share constraints with robots above."""
        own = linked.get(self.problem.agent, ())
        if child not in own or child in self.asked or not {*own} <= {*self.descendants}:
            raise ValueError(f"{child} sends impossible links: {linked}")
        self.asked[child] = [*own]
        self.members[child] = [*dict.fromkeys(name for names in linked.values() for name in names)]
        self._child_above.update(dict.fromkeys(own, child))
        for above, names in linked.items():
            if above != self.problem.agent:
                self._linked.setdefault(above, []).extend(names)
        self._send_members()

    def _send_members(self) -> None:
        if len(self.asked) < len(self.children):
            return
        if self.parent is not None:
            self.send(self.parent, Members(self._linked))
        else:
            self.begin_search()

    # Bounds

    def floor(self, child: str) -> Sequence[Number]:
        # The bounds on its robots that were handed down.
        return [sum(self.handed.get(name, 0) for name in self.members[child])] * len(self.problem.values)

    def request_bound(self, child: str) -> None:
        """Ask all linked robots in the child's subtree."""
        value = self.problem.values[self.present(child)]
        self._waiting[child] = {*self.asked[child]}
        for name in self.asked[child]:
            self.send(name, Request(value))

    def answer_request(self, sender: str, value: Value) -> None:
        """Answer with a lower bound, or, as a leaf that answers its parent, with the cost."""
        if sender not in self.ancestors:
            raise ValueError(f"{sender} is not above {self.problem.agent}")
        costs = self.above.ask(sender, value)
        least = min(costs)
        if not self.knows_cost(sender):
            self.send(sender, Report(least))
        else:
            value = self.problem.values[costs.index(least)]
            self.send(sender, Result(least, {self.problem.agent: value} if least < INFINITE else {}))

    def knows_cost(self, sender: str) -> bool:
        """Return whether the least cost of a value is the cost of the whole subtree, once `sender` has asked."""
        return sender == self.parent and not self.children

    def store_report(self, sender: str, bound: Number) -> None:
        """Store a bound; when all bounds have arrived, let the child search or try the next value."""
        child = self._child_above.get(sender)
        if child is None or sender not in self._waiting.get(child, ()):
            raise ValueError(f"unexpected bound from {sender}, which was not asked")
        self.answers[sender] = bound
        self._waiting[child].remove(sender)
        if not self._waiting[child]:
            branch = self.branches[child]
            branch.lower[self.present(child)] = sum([self.reports.get(name, 0) for name in self.members[child]])
            self.descend(child)

    def child_above(self, robot: str) -> str:
        """Return the child whose subtree contains a linked `robot`; raise `ValueError` for any other robot."""
        if robot not in self._child_above:
            raise ValueError(f"{robot} is not known to be below {self.problem.agent}")
        return self._child_above[robot]

    def store_result(self, child: str, result: Result) -> None:
        """Store the cost of a subtree; the result of a leaf is its answer to the request."""
        self._waiting.pop(child, None)
        super().store_result(child, result)

    @property
    def reports(self) -> Mapping[str, Number]:
        """The latest bound on each robot in this robot's subtree."""
        return {**self.handed, **self.answers}
