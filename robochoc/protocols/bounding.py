"""What ADOPT and BnB-ADOPT share: contexts, and for each own value the bounds on what it costs.

Names and formulas are those of both papers (`adopt`, `bnb_adopt`). In the present context the subtree of child l costs
between `lb(d, l)` and `ub(d, l)` if this robot takes value d; with what is paid here, delta(d), that makes LB(d) and
UB(d), and LB and UB are the least of them. A context says who above has which value; it is what a bound rests on.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from robochoc.model import message
from robochoc.model.message import Message
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.model.wording import Wording, cost_text
from robochoc.protocols import acts
from robochoc.protocols.dfs import TreeProtocol
from robochoc.protocols.findings import Findings
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.compiled import LocalProblem

Entry = tuple[message.Value, int]
"""A robot's value, and the counter that says how often it has changed (the ID of BnB-ADOPT)."""

Context = dict[str, Entry]
"""The values of robots above, as far as they are known."""

Number = int | float
"""Infinite where something hard is broken, or nothing is known yet; integers stay integers on the wire."""


class Terminate(Message, frozen=True):
    """All above the receiver have taken their last values: those in `context` (TERMINATE)."""

    context: Context

    act = acts.TERMINATE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        condition = words.context(self.context).removeprefix("as long as ").removesuffix(", ")
        return f"all above you have taken their last values{': ' if condition else ''}{condition}"


def bounds_in_words(words: Wording, context: Context, lower: Number, upper: Number) -> str:
    """Return what a robot says of its subtree's cost: `as long as V1.1 = 2, my subtree costs at least 3`."""
    if math.isinf(lower):
        costs = "has no solution"
    elif lower == upper:
        costs = f"costs {cost_text(lower)}"
    elif math.isinf(upper):
        costs = f"costs at least {cost_text(lower)}"
    else:
        costs = f"costs between {cost_text(lower)} and {cost_text(upper)}"
    return f"{words.context(context)}my subtree {costs}"


class Bounds:
    """On the costs of a child's subtree, for each own value, in a context.

    `scope` are those above, without this robot, on whose values the subtree depends, as far as the child has said.
    """

    def __init__(self, size: int, scope: Iterable[str] = ()) -> None:
        self.scope = {*scope}
        self.lb: list[float] = [0] * size
        self.ub: list[float] = [INFINITE] * size


class BoundingProtocol(TreeProtocol):
    """One agent with bounds. State: `context` (CurrentContext), and for each child the `bounds` on its subtree.

    `counter` says how often the own value has changed. `lower` and `upper` are LB(d) and UB(d) for each value, `lb`
    and `ub` are LB and UB: weighed anew once the inbox has been drained, before the robot is to `act`. `last_values`:
    all above have taken their last values; `terminated`: so has this robot.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.context: Context = {}
        self.counter = 0
        self.bounds: dict[str, Bounds] = {}
        self.delta: Sequence[float] = problem.charges
        self.lower: Sequence[float] = problem.charges
        self.upper: Sequence[float] = [INFINITE] * len(problem.values)
        self.lb: float = 0
        self.ub: float = INFINITE
        self.last_values = False
        self.terminated = False
        self._outdated = False
        self._places = {value: index for index, value in enumerate(problem.values)}
        self._last: dict[tuple[str, type[Message]], Message] = {}

    def begin(self) -> None:
        """Nothing is known but the own charges."""
        for child in self.children:
            self.bounds[child] = Bounds(len(self.problem.values))
            self.forget(child)
        self.take(self.least(self.delta))

    @abstractmethod
    def act(self) -> None:
        """The bounds are up to date: take a value, and say what is new."""

    def decide(self) -> None:
        """Weigh the bounds and act; a root that finds every value too dear ends the search of all trees."""
        if self.terminated:
            return
        self._weigh()
        if self.parent is None and self.lb == INFINITE:
            self.conclude(Verdict.NO_SOLUTION)
        else:
            self.act()

    @property
    def findings(self) -> Findings:
        """The place in the tree; a root's LB is a bound on what its tree costs."""
        root = self.placed and self.parent is None
        return msgspec.structs.replace(super().findings, bound=self.lb if root else None)

    def forget(self, child: str) -> None:
        """What `child` has said does not hold any more."""
        self.bounds[child] = Bounds(len(self.problem.values), self.bounds[child].scope)

    # Contexts

    def merge(self, context: Mapping[str, Entry]) -> tuple[list[str], bool]:
        """Take up what is newer: whose values are news, and whether any of them was another one before.

        Bounds that rest on such a one are forgotten.
        """
        news = [name for name, entry in context.items() if self._is_newer(name, entry)]
        other = [name for name in news if self.context.get(name, context[name])[0] != context[name][0]]
        fresh = [name for name in news if name not in self.context]
        self.context.update({name: context[name] for name in news})
        self._outdated = self._outdated or bool(set(self.ancestors) & {*fresh, *other})
        for child in self.children:
            if self.bounds[child].scope & {*other}:
                self.forget(child)
        return [*fresh, *other], bool(other)

    def agrees(self, values: Mapping[str, message.Value]) -> bool:
        """Whether nobody has another value in the context (the papers' Compatible)."""
        return all(self.context[name][0] == value for name, value in values.items() if name in self.context)

    def _is_newer(self, name: str, entry: Entry) -> bool:
        return name != self.problem.agent and (name not in self.context or self.context[name][1] < entry[1])

    # Bounds

    def bound(self, child: str, context: Mapping[str, Entry], lb: float, ub: float) -> int | None:
        """What a Cost says of `child`, after its context has been merged; the own value that it is said of.

        None: of no value, as the child did not know it yet, or its context is obsolete.
        """
        values = {name: value for name, (value, _) in context.items()}
        own = values.pop(self.problem.agent, None)
        if own is None or not self.agrees(values):
            return None
        index = self._places[own]
        bounds = self.bounds[child]
        bounds.scope |= values.keys()
        bounds.lb[index] = max(bounds.lb[index], lb)
        bounds.ub[index] = min(bounds.ub[index], ub)
        return index

    def _weigh(self) -> None:
        """LB(d), UB(d), LB and UB in the present context.

        Nothing is known of UB before all neighbours above have told their values, as delta(d) may still grow.
        """
        if self._outdated:
            self._outdated = False
            self.delta = self.problem.costs({name: self.context[name][0] for name in self._known})
        bounds = self.bounds.values()
        self.lower = [sum(parts) for parts in zip(self.delta, *(one.lb for one in bounds), strict=True)]
        if len(self._known) == len(self.ancestors):
            self.upper = [sum(parts) for parts in zip(self.delta, *(one.ub for one in bounds), strict=True)]
        else:
            self.upper = [INFINITE] * len(self.lower)
        self.lb, self.ub = min(self.lower), min(self.upper)

    def least(self, costs: Sequence[float]) -> int:
        """The value with the least of `costs`: the present one if it is among several."""
        return min(range(len(costs)), key=lambda index: (costs[index], index != self.value))

    @property
    def _known(self) -> list[str]:
        """The neighbours above whose values are known."""
        return [name for name in self.ancestors if name in self.context]

    # The own value, and what is said of it

    def take(self, index: int) -> None:
        """Take the value at `index`."""
        if index != self.value:
            self.value = index
            self.counter += 1

    @property
    def index(self) -> int:
        """The place of the own value; there is one since `begin`."""
        assert self.value is not None  # noqa: S101
        return self.value

    @property
    def own(self) -> Entry:
        """The own value as contexts have it."""
        return self.problem.values[self.index], self.counter

    @property
    def may_end(self) -> bool:
        """Whether no value above will change any more."""
        return self.parent is None or self.last_values

    def terminate(self) -> None:
        """This was the last value: tell the children, and be silent."""
        self.terminated = True
        for child in self.children:
            self.send(child, Terminate({**self.context, self.problem.agent: self.own}))

    def tell(self, receiver: str, said: Message) -> None:
        """Say what is new: not what `receiver` has been told last by a message of that type."""
        if self._last.get((receiver, type(said))) != said:
            self._last[receiver, type(said)] = said
            self.send(receiver, said)

    def value_notes(self, index: int) -> Mapping[str, float]:
        """Return LB(d) and UB(d) of the value at `index`."""
        return {"LB": self.lower[index], "UB": self.upper[index]}
