"""The common base of NCBB, PT-FB and HS-CAI: separate branch and bound in each subtree of a pseudo-tree.

While the robots above keep their values, a robot has the subtrees of its children searched for a cost below a limit. It
does not commit to a value: it tries its values in each subtree by increasing lower bound, and different subtrees may be
searched with different values at the same time. For each value and child the robot knows a lower bound on the subtree's
cost. Later it knows the cost itself, or that no solution with the value costs less than the best known solution. A
value is ruled out once its own cost and the bounds of all subtrees add up to the cost of that solution. The cheapest
value whose subtrees have all been searched is the best.

A child returns the best assignment of its subtree with the assignment's cost. So nothing is searched again, and the
root knows the best assignment of its tree at any time.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import (
    AT_THE_END,
    NOTHING,
    EveryValuePays,
    HasValue,
    Pays,
    Proof,
    Reception,
    SomeValuePays,
    can_take,
)
from robochoc.protocols.findings import Findings, Incumbent
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import listed

Number = int | float
"""Infinite if a hard constraint is broken, or if the cost is unknown; integers remain integers in messages."""


class Members(Message, frozen=True):
    """For each robot above, the robots in the sender's subtree that share a constraint with it."""

    linked: dict[str, list[str]]

    act = Act(Performative.INFORM, "the receiver learns the links between robots below and above it")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        shared = [f"{listed(names)} with {robot}" for robot, names in self.linked.items()]
        return f"in my subtree constraints are shared by {listed(shared)}"


class Request(Message, frozen=True):
    """A request for a lower bound on the receiver's cost given this value of the sender."""

    value: Value

    act = Act(Performative.QUERY_REF, "the sender asks for a lower bound on the receiver's cost")

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} for now; what will you cost at least?"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [can_take(reception.sender, self.value)]


class Report(Message, frozen=True):
    """A lower bound on the sender's own cost, given the values of the receiver and of robots above it."""

    bound: Number

    act = acts.TELL_BOUNDS

    def in_words(self, _: Wording) -> str:
        if math.isinf(self.bound):
            return "no value of mine is allowed with your value and those above you"
        return f"with your value and those above you, I cost at least {cost_text(self.bound)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The receiver may not know the values above it.
        asked = reception.last(Request, reception.receiver, reception.sender)
        return (
            NOTHING
            if asked is None
            else [SomeValuePays(reception.sender, {reception.receiver: asked.value}, self.bound)]
        )


class Result(Message, frozen=True):
    """The cost of the sender's subtree and its `values`; infinite without values if no cost is below the bound."""

    cost: Number
    values: dict[str, Value]

    act = acts.TELL_BOUNDS

    def in_words(self, words: Wording) -> str:
        if math.isinf(self.cost):
            return "my subtree has nothing that costs less than you allow"
        return f"my subtree costs {cost_text(self.cost)}, with {words.assigned(self.values.items())}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # No robot in the subtree pays more than all of them together. A sender that shares constraints only with the
        # receiver answers with its least cost.
        found: list[Proof] = []
        asked = reception.last(Request, reception.receiver, reception.sender)
        view = {} if asked is None else {reception.receiver: asked.value}
        for robot, value in self.values.items():
            found.append(Pays(robot, value, {**view, **_without(robot, self.values)}, 0, self.cost))
        if asked is not None and reception.is_only_neighbour():
            found.append(EveryValuePays(reception.sender, view, self.cost))
        return found


class Terminate(Message, frozen=True):
    """The end of the search: the final values of the receiver's subtree."""

    values: dict[str, Value]

    act = acts.TERMINATE

    def in_words(self, words: Wording) -> str:
        return f"the search is over, with {words.assigned(self.values.items())}"

    def proves(self, _: Reception) -> Sequence[Proof]:
        return [HasValue(robot, value, AT_THE_END) for robot, value in self.values.items()]


def allowance(bound: Number) -> str:
    """Return the maximum cost of a subtree in words."""
    return "whatever it costs" if math.isinf(bound) else f"for less than {cost_text(bound)}"


def _without(robot: str, values: dict[str, Value]) -> dict[str, Value]:
    return {other: value for other, value in values.items() if other != robot}


Assignment = dict[str, Value]
"""The values of the robots in a subtree."""


class Branch:
    """The search of a child's subtree, for each value of this robot.

    - `lower`: a lower bound on the subtree's cost. Once the value is `known`, this is the cost itself, or infinite: no
      solution with the value costs less than the best known one.
    - `values`: the assignment that has this cost.
    - `index`: the value that is being searched; None if all have been searched. `sent_limit`: the limit that the child
      has received for this value; None if its search has not begun.
    """

    def __init__(self, lower: Sequence[Number]) -> None:
        self.lower = [*lower]
        self.known = [False] * len(lower)
        self.values: dict[int, Assignment] = {}
        self.index: int | None = None
        self.sent_limit: Number | None = None

    @property
    def left(self) -> list[int]:
        """The values that have not been searched yet."""
        return [index for index, known in enumerate(self.known) if not known]

    def close(self, indices: Iterable[int], cost: Number = INFINITE) -> None:
        """Store the cost of values; infinite means that they are ruled out."""
        for index in indices:
            self.lower[index] = cost
            self.known[index] = True


@mypyc_attr(allow_interpreted_subclasses=True)
class BranchingProtocol(TreeProtocol):
    """One agent that searches its children's subtrees.

    - `branches`: the search of each child. `local`: the cost of each value of this robot with the values above.
    - `limit`: only lower costs matter to the robots above. `best` and `solution`: the cheapest assignment of the
      subtree below this limit.
    - `searching`: the subtree is being searched. `over`: the search of the whole tree has ended.
    - `optimum`: at the root, its tree's least cost, once it is known.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.branches: dict[str, Branch] = {}
        self.local: Sequence[Number] = problem.charges
        self.limit: Number = INFINITE
        self.best: Number = INFINITE
        self.solution: Assignment = {}
        self.searching = False
        self.over = False
        self.optimum: Number | None = None
        self._below: dict[str, tuple[str, ...]] = {}

    @abstractmethod
    def request_bound(self, child: str) -> None:
        """Request a lower bound for the current value in the child's branch; call `descend` when it has arrived."""

    @abstractmethod
    def explore(self, child: str, limit: Number) -> None:
        """Request that `child` search its subtree for a cost below `limit`, with the current value in its branch."""

    def tighten(self, child: str, limit: Number) -> None:
        """Send a lower limit to `child`, which is searching. Not all protocols do so."""

    def floor(self, child: str) -> Sequence[Number]:  # noqa: ARG002 - for those that know one
        """Return a lower bound on the cost of the child's subtree for each value of this robot, before any request."""
        return [0] * len(self.problem.values)

    # The search

    @property
    def bound(self) -> Number:
        """The cost that a solution must stay below."""
        return min(self.limit, self.best)

    def search(self, limit: Number, local: Sequence[Number]) -> None:
        """Search the subtree for a cost below `limit`; `local` is the cost of each value with the values above."""
        self.limit = limit if self.parent is not None else min(limit, self.problem.upper_bound)
        self.local = local
        self.best, self.solution = INFINITE, {}
        self.searching = True
        self.branches = {child: Branch(self.floor(child)) for child in self.children}
        if not self.children:
            self._improve(self.cheapest)
        for child in self.children:
            self._advance(child)
        self._finish_if_idle()

    def estimate(self, index: int) -> Number:
        """Return a lower bound on the cost of this robot's subtree with the value at `index`."""
        return sum([branch.lower[index] for branch in self.branches.values()], self.local[index])

    @property
    def cheapest(self) -> int:
        """The index of this robot's cheapest value with the values above."""
        return min(range(len(self.local)), key=self.local.__getitem__)

    def descend(self, child: str) -> None:
        """Let `child` search, or choose the next value if the arrived bound rules the current one out."""
        index = self.present(child)
        branch = self.branches[child]
        total = self.estimate(index)
        if total < self.bound:
            self.value = index
            branch.sent_limit = self.bound - (total - branch.lower[index])
            self.explore(child, branch.sent_limit)
        else:
            branch.close([index])
            self._advance(child)
            self._finish_if_idle()

    def store_result(self, child: str, result: Result) -> None:
        """Store the result of the search of a child's subtree, and continue."""
        index = self.present(child)
        branch = self.branches[child]
        branch.close([index], result.cost)
        if result.cost < INFINITE:
            self.store_subtree(child, result)
            branch.values[index] = result.values
        if all(other.known[index] for other in self.branches.values()):
            self._improve(index)
        self._advance(child)
        self.send_lower_limits()
        self._finish_if_idle()

    def present(self, child: str) -> int:
        """Return the index of the value that is being searched in the subtree of `child`.

        Raises:
            ValueError: if no value is being searched, so that `child` must not send anything.
        """
        branch = self.branches.get(child)
        if branch is None or branch.index is None or not self.searching:
            raise ValueError(f"unexpected message from {child}, which has no open request")
        return branch.index

    def store_subtree(self, child: str, result: Result) -> None:
        """Store the robots in the subtree of `child`, from its first assignment."""
        if child not in result.values or self.problem.agent in result.values:
            raise ValueError(f"{child} sent an assignment without its own value, or with that of {self.problem.agent}")
        self._below.setdefault(child, tuple(result.values))

    def send_lower_limits(self) -> None:
        """Send the searching children those limits that have become lower (`tighten`)."""
        for child, branch in self.branches.items():
            if branch.index is not None and branch.sent_limit is not None:
                total = self.estimate(branch.index)
                rest = self.bound - (total - branch.lower[branch.index]) if total < self.bound else 0
                if rest < branch.sent_limit:
                    branch.sent_limit = rest
                    self.tighten(child, rest)

    def _advance(self, child: str) -> None:
        """Choose the value with the least lower bound in the subtree of `child`; without one, the branch is idle."""
        branch = self.branches[child]
        left = branch.left
        index = min(left, key=self.estimate, default=None)
        branch.index = branch.sent_limit = None
        if index is None or self.estimate(index) >= self.bound:
            branch.close(left)
            return
        branch.index = index
        self.request_bound(child)

    def _improve(self, index: int) -> None:
        """Store the value at `index` as the best one if it is better: the costs of all its subtrees are known."""
        cost = self.estimate(index)
        if cost < self.bound:
            self.best = cost
            self.solution = {self.problem.agent: self.problem.values[index]}
            for branch in self.branches.values():
                self.solution.update(branch.values[index])

    def _finish_if_idle(self) -> None:
        """Once all branches are idle, send the best value to the parent, or end the search as the root."""
        if not self.searching or any(branch.index is not None for branch in self.branches.values()):
            return
        self.searching = False
        if self.parent is not None:
            self.send(self.parent, Result(self.best, self.solution))
        else:
            self.end_search(self.best, self.solution)

    # The end

    def end_search(self, cost: Number, solution: Assignment) -> None:
        """End the search of the whole tree with its optimum, as the root."""
        if cost == INFINITE:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.optimum = cost
        self.finish(solution)

    def finish(self, values: Mapping[str, Value]) -> None:
        """Choose this robot's final value, and send the children the final values in their subtrees.

        Raises:
            ValueError: if a value is missing, or the value of this robot is invalid.
        """
        wanted = {self.problem.agent, *(name for names in self._below.values() for name in names)}
        if not wanted <= values.keys() or len(self._below) < len(self.children):
            raise ValueError(f"the final values of {self.problem.agent} and the robots below it are incomplete")
        # The first of several values that look alike to neighbours, because the last may mean withdrawal.
        self.value = self.problem.values.index(values[self.problem.agent])
        self.over = True
        for child in self.children:
            self.send(child, Terminate({name: values[name] for name in self._below[child]}))

    # Knowledge about the whole search

    @property
    def incumbent(self) -> Incumbent | None:
        """The cheapest assignment that this root knows, if it contains all robots."""
        if self.parent is not None or len(self.solution) < len(self.order.names):
            return None
        return Incumbent(self.best, self.solution)

    @property
    def findings(self) -> Findings:
        """The position in the tree; for a root also its best assignment, and a lower bound on the cost of its tree."""
        return msgspec.structs.replace(super().findings, best=self.incumbent, bound=self._bound_of_tree())

    def _bound_of_tree(self) -> Number | None:
        if not self.searching or self.parent is not None:
            return self.optimum
        return min(self.bound, *map(self.estimate, range(len(self.local))))
