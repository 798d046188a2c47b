"""The messages of Synchronous Branch and Bound (see `syncbb.py`)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from robochoc.model.disclosure import EveryValuePays, Hearing, Pays, Proof, StandsAt, Total
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, cost_text, incumbent_text
from robochoc.protocols import acts

Cost = int | float


class BestPath(msgspec.Struct, frozen=True, array_like=True):
    """The best path so far: all robots' values in priority order, and its cost (the bound; `inf`: none yet)."""

    bound: Cost
    values: tuple[Value, ...] = ()


class Path(Message, frozen=True):
    """The values of all robots before the receiver, in priority order, with the cost that each of them pays."""

    assignments: list[tuple[Value, Cost]]
    best: BestPath

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        values = words.partial([value for value, _ in self.assignments])
        paid = cost_text(sum(cost for _, cost in self.assignments))
        known = incumbent_text(self.best.bound)
        return f"so far {values}, which costs {paid}; {known}; it is {words.receiver}'s turn"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        found = best_proves(self.best, hearing)
        view: dict[str, Value] = {}
        for robot, (value, cost) in zip(hearing.order, self.assignments, strict=False):
            found += [StandsAt(robot, value), Pays(robot, value, dict(view), cost, cost)]
            view[robot] = value
        return found


class Backtrack(Message, frozen=True):
    """A request to take the next value: every path with the receiver's value costs at least the bound."""

    best: BestPath

    act = acts.REJECT_VALUE
    backtracks = True

    def in_words(self, words: Wording) -> str:
        if math.isinf(self.best.bound):
            return f"{words.receiver}'s value leads to no solution: take another one"
        bound = cost_text(self.best.bound)
        return f"{words.receiver}'s value leads to nothing that costs less than {bound}: take another one"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        found = best_proves(self.best, hearing)
        path = hearing.last(Path, hearing.receiver, hearing.sender)
        if path is not None and hearing.is_lowest(hearing.sender):
            view = {robot: value for robot, (value, _) in zip(hearing.order, path.assignments, strict=False)}
            left = self.best.bound - sum(cost for _, cost in path.assignments)
            found.append(EveryValuePays(hearing.sender, view, left))
        return found


class Terminate(Message, frozen=True):
    """The end of the search: no path is cheaper than the best one."""

    best: BestPath

    act = acts.TERMINATE

    def in_words(self, words: Wording) -> str:
        if math.isinf(self.best.bound):
            return "the search is over, and there is no solution"
        values = words.partial(self.best.values)
        return f"the search is over: nothing costs less than {cost_text(self.best.bound)}, with {values}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        stands = [StandsAt(robot, value) for robot, value in zip(hearing.order, self.best.values, strict=False)]
        return [*stands, *best_proves(self.best, hearing)]


def best_proves(best: BestPath, hearing: Hearing) -> list[Proof]:
    """Return what the best path proves."""
    return [Total(dict(zip(hearing.order, best.values, strict=False)), best.bound)] if best.values else []
