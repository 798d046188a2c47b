"""The common base of ADOPT and BnB-ADOPT: contexts, and bounds on the cost of each value of a robot.

Names and formulas are those of both papers (`adopt`, `bnb_adopt`). In the current context the subtree of child l costs
between `lb(d, l)` and `ub(d, l)` if this robot takes value d; adding this robot's cost, delta(d), gives LB(d) and
UB(d), and LB and UB are their minima over d. A context contains the values of robots above on which a bound depends.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols import message
from robochoc.protocols.findings import Findings
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.bounding_messages import Context, Entry, Number, Terminate
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


class Bounds:
    """Bounds on the cost of a child's subtree, for each value of this robot, in a context.

    `scope` contains the ancestors, without this robot, on whose values the subtree depends, as far as the child has
    sent them.
    """

    def __init__(self, size: int, scope: Iterable[str] = ()) -> None:
        self.scope = {*scope}
        self.lb: list[Number] = [0] * size
        self.ub: list[Number] = [INFINITE] * size


@mypyc_attr(allow_interpreted_subclasses=True)
class BoundingProtocol(TreeProtocol):
    """One agent with bounds. State: `context` (CurrentContext), and for each child its `bounds`.

    - `counter`: the number of changes of the value.
    - `lower` and `upper`: LB(d) and UB(d) for each value. `lb` and `ub`: LB and UB. All are computed when the inbox is
    empty, before `act`.
    - `last_values`: all ancestors have taken their final values. `terminated`: this robot has taken its final value,
      too.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.context: Context = {}
        self.counter = 0
        self.bounds: dict[str, Bounds] = {}
        self.delta: Sequence[Number] = problem.charges
        self.lower: Sequence[Number] = problem.charges
        self.upper: Sequence[Number] = [INFINITE] * len(problem.values)
        self.lb: Number = 0
        self.ub: Number = INFINITE
        self.last_values = False
        self.terminated = False
        self._outdated = False
        self._places = {value: index for index, value in enumerate(problem.values)}
        self._last: dict[tuple[str, type[Message]], Message] = {}

    def start_in_tree(self) -> None:
        """Initialise the bounds with this robot's charges."""
        for child in self.children:
            self.bounds[child] = Bounds(len(self.problem.values))
            self.forget(child)
        self.assign(self.cheapest(self.delta))

    @abstractmethod
    def act(self) -> None:
        """Choose a value and send the changes; the bounds are up to date."""

    def decide(self) -> None:
        """Compute the bounds and act; a root whose lower bound reaches the upper bound ends the search of all trees."""
        if self.terminated:
            return
        self._weigh()
        if self.parent is None and self.lb >= self.problem.upper_bound:
            self.conclude(Verdict.NO_SOLUTION)
        else:
            self.act()

    @property
    def findings(self) -> Findings:
        """The position in the tree; for a root also LB, a lower bound on the cost of its tree."""
        root = self.placed and self.parent is None
        return msgspec.structs.replace(super().findings, bound=self.lb if root else None)

    def forget(self, child: str) -> None:
        """Drop the bounds of `child`."""
        self.bounds[child] = Bounds(len(self.problem.values), self.bounds[child].scope)

    # Contexts

    def merge(self, context: Mapping[str, Entry]) -> tuple[list[str], bool]:
        """Merge newer values into the context; return the changed robots, and whether a known value changed.

        Bounds are dropped if their context contains an old value.
        """
        news = [name for name, entry in context.items() if self._is_newer(name, entry)]
        if not news:
            return [], False
        other = [name for name in news if self.context.get(name, context[name])[0] != context[name][0]]
        fresh = [name for name in news if name not in self.context]
        self.context.update({name: context[name] for name in news})
        self._outdated = self._outdated or bool(set(self.ancestors) & {*fresh, *other})
        for child in self.children:
            if self.bounds[child].scope & {*other}:
                self.forget(child)
        return [*fresh, *other], bool(other)

    def agrees(self, values: Mapping[str, message.Value]) -> bool:
        """Return whether `values` do not contradict the context (the papers' Compatible)."""
        for name, value in values.items():
            known = self.context.get(name)
            if known is not None and known[0] != value:
                return False
        return True

    def _is_newer(self, name: str, entry: Entry) -> bool:
        known = self.context.get(name)
        return name != self.problem.agent if known is None else known[1] < entry[1]

    # Bounds

    def bound(self, child: str, context: Mapping[str, Entry], lb: Number, ub: Number) -> int | None:
        """Store the bounds in a Cost from `child`, after its context was merged; return the value that they apply to.

        Return None if there is no such value: the child did not know the value yet, or its context is obsolete.
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
        """Compute LB(d), UB(d), LB and UB in the current context.

        UB is infinite until the values of all neighbours above are known, because delta(d) may still grow.
        """
        if self._outdated:
            self._outdated = False
            self.delta = self.costs_in({name: self.context[name][0] for name in self._known})
        bounds = self.bounds.values()
        self.lower = [sum(parts) for parts in zip(self.delta, *(one.lb for one in bounds), strict=True)]
        if len(self._known) == len(self.ancestors):
            self.upper = [sum(parts) for parts in zip(self.delta, *(one.ub for one in bounds), strict=True)]
        else:
            self.upper = [INFINITE] * len(self.lower)
        self.lb, self.ub = min(self.lower), min(self.upper)

    def costs_in(self, view: Mapping[str, message.Value]) -> list[Number]:
        """Return the cost of each value of this robot with the values of neighbours above in `view` (delta)."""
        return self.problem.costs(view)

    def cheapest(self, costs: Sequence[Number]) -> int:
        """Return the value with the minimum of `costs`; if there are several, the current value if it is among them."""
        least = min(costs)
        if self.value is not None and costs[self.value] == least:
            return self.value
        return costs.index(least)

    @property
    def _known(self) -> list[str]:
        """The neighbours above whose values are known."""
        return [name for name in self.ancestors if name in self.context]

    # This robot's value, and messages about it

    def assign(self, index: int) -> None:
        """Choose the value at `index`."""
        if index != self.value:
            self.value = index
            self.counter += 1

    @property
    def index(self) -> int:
        """The index of the value in the domain; available after `start_in_tree`."""
        assert self.value is not None  # noqa: S101
        return self.value

    @property
    def own(self) -> Entry:
        """This robot's value as an entry of a context."""
        return self.problem.values[self.index], self.counter

    @property
    def may_end(self) -> bool:
        """True if all ancestors' values are final."""
        return self.parent is None or self.last_values

    def terminate(self) -> None:
        """Keep the current value permanently: send `Terminate` to the children, and nothing afterwards."""
        self.terminated = True
        for child in self.children:
            self.send(child, Terminate({**self.context, self.problem.agent: self.own}))

    def send_if_new(self, receiver: str, message: Message) -> None:
        """Send a message to `receiver` unless it equals the last message of its type sent there."""
        key = receiver, type(message)
        last = self._last.get(key)
        if last is not message and last != message:
            self._last[key] = message
            self.send(receiver, message)

    def value_notes(self, index: int) -> Mapping[str, float]:
        """Return LB(d) and UB(d) of the value at `index`."""
        return {"LB": self.lower[index], "UB": self.upper[index]}


def clamp_share(t: list[Number], bounds: Bounds, index: int) -> None:
    """Keep a child's share within its bounds, for the value at `index`: lb(d, l) <= t(d, l) <= ub(d, l)."""
    t[index] = min(max(t[index], bounds.lb[index]), bounds.ub[index])


def split_threshold(
    threshold: Number, shares: Mapping[str, list[Number]], bounds: Mapping[str, Bounds], index: int
) -> None:
    """Change the children's shares for the value at `index` until they add up to `threshold`, which is finite."""
    spare = threshold - sum(t[index] for t in shares.values())
    for child, t in shares.items():
        limits = bounds[child]
        step = min(spare, limits.ub[index] - t[index]) if spare > 0 else max(spare, limits.lb[index] - t[index])
        t[index] += step
        spare -= step
