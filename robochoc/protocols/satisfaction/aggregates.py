"""Aggregates, sets of a robot's values, and the store of nogoods over them (see `aas.py`).

A nogood over aggregates, `x_1 in S_1, ..., x_k in S_k => x_i != v`, says that no solution has v while all robots of the
left side have a value of their sets. So it holds as long as what each of them proposes is covered by its set.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from robochoc.model.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.nogood import contradicts, joined

Aggregate = tuple[Value, ...]
"""Values of one robot, each once; in nogoods None where a variable does not matter."""

LeftSide = Mapping[str, Aggregate]


def covers(aggregate: Iterable[Value], values: Iterable[Value]) -> bool:
    """Return whether each of `values` agrees with one in `aggregate`."""
    if aggregate == values:
        return True
    return all(any(not contradicts(one, value) for one in aggregate) for value in values)


def met(left: Aggregate, right: Aggregate) -> Aggregate:
    """Return the intersection of two aggregates of one robot, with all variables that matter in either."""
    if left == right:
        return left
    pairs = ((one, other) for one in left for other in right if not contradicts(one, other))
    return tuple(dict.fromkeys(joined(one, other) for one, other in pairs))


def matching(patterns: Iterable[Value], values: Iterable[Value]) -> Aggregate:
    """Return those of `values` that agree with one of `patterns`."""
    return tuple([value for value in values if any(not contradicts(one, value) for one in patterns)])


def left_side(conflicts: Sequence[Mapping[str, Value]]) -> LeftSide:
    """Return the aggregates whose combinations are `conflicts`: all combinations of what they contain."""
    return {agent: tuple(dict.fromkeys(one[agent] for one in conflicts)) for agent in conflicts[0]}


class AggregateStore:
    """The left sides of the nogoods that rule out own values, at most one for each value."""

    def __init__(self, order: PriorityOrder, size: int) -> None:
        self._order = order
        self._by_value: list[LeftSide | None] = [None] * size

    def __getitem__(self, index: int) -> LeftSide | None:
        return self._by_value[index]

    def all_open(self) -> list[int]:
        """Return all values that no nogood rules out."""
        return [index for index, lhs in enumerate(self._by_value) if lhs is None]

    def add(self, index: int, lhs: LeftSide) -> None:
        """Store `lhs` against the value at `index`, unless a better nogood is stored there.

        Better: the higher lowest variable (Hirayama and Yokoo 2000), or shorter.
        """
        present = self._by_value[index]
        if present is None or self._weakness(lhs) < self._weakness(present):
            self._by_value[index] = lhs

    def forget(self, agent: str, aggregate: Aggregate | None = None) -> None:
        """Drop all nogoods about `agent` that do not cover `aggregate` (None: all about it)."""
        for index, lhs in enumerate(self._by_value):
            if lhs is not None and agent in lhs and (aggregate is None or not covers(lhs[agent], aggregate)):
                self._by_value[index] = None

    def resolve(self, view: Mapping[str, Aggregate]) -> dict[str, Aggregate]:
        """Return the conjunction of all left sides: the resolvent, if every value has a nogood.

        Where an intersection of sets in different variables would be larger than both, what is not in `view` is left
        out.
        """
        found: dict[str, Aggregate] = {}
        for lhs in {id(lhs): lhs for lhs in self._by_value if lhs is not None}.values():
            for agent, aggregate in lhs.items():
                before = found.get(agent, aggregate)
                both = met(before, aggregate)
                large = len(both) > max(len(before), len(aggregate))
                found[agent] = matching(view[agent], both) if large else both
        return found

    def _weakness(self, lhs: LeftSide) -> tuple[int, int]:
        return self._order.depth(lhs), len(lhs)
