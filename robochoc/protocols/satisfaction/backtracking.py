"""The common base of ABT and its variants with other orders: the view, and the nogoods that depend on it.

This file contains `Update` and `ChooseValue` of the kernel (Bessiere, Maestre, Brito, Meseguer, AIJ 161, 2005, Figure
1); the sending of messages is in each protocol's file.
"""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.nogood import NogoodStore, joined
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class Backtracking(Protocol):
    """One agent with a `view` of others' values (myAgentView) and a `store` of nogoods (myNogoodStore).

    `higher` are the robots that send their values to this one (Gamma-) while they have higher priority.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.view: dict[str, Value] = {}
        self.store = NogoodStore(order, len(problem.values))
        self.higher = set(problem.parents)

    def _choose_value(self, view: Mapping[str, Value]) -> int | None:
        """Return the first value of the domain that no nogood rules out in `view`; None if there is none.

        The start value, if it is known, is tried before all others.
        """
        start = self.problem.start
        if start is not None and self._consistent(start, view):
            return start
        index = self.store.first_open()
        while index is not None and not self._consistent(index, view):
            index = self.store.first_open(index + 1)
        return index

    def _consistent(self, index: int, view: Mapping[str, Value]) -> bool:
        """Return whether `view` allows the value at `index`; store a nogood if a constraint is violated."""
        if self.store[index] is not None:
            return False
        conflict = self.problem.conflict(index, view)
        if conflict is None:
            return True
        self.store.add(index, conflict)
        return False

    def _update(self, agent: str, value: Value | None) -> None:
        """Store a new value of `agent` (None: unknown); drop nogoods that contain another value of `agent`."""
        if value is None:
            self.view.pop(agent, None)
        else:
            self.view[agent] = value
        self.store.forget(agent, value)

    def _assume(self, lhs: Mapping[str, Value]) -> list[str]:
        """Assume the values in `lhs`; return the robots that do not send their values to this robot yet."""
        new = [agent for agent in lhs if agent not in self.higher]
        self.higher.update(new)
        for agent, value in lhs.items():
            known = self.view.get(agent)
            more = joined(known, value)
            if more != known:
                self._update(agent, more)
        return new

    def _current(self) -> Value | None:
        """Return this robot's value as others see it; None while unassigned."""
        return None if self.value is None else self.problem.values[self.value]
