"""Nogoods and the store that keeps at most one for each value of the own domain.

A nogood `lhs => x_i != v` says that x_i cannot take v while all assignments of its left side stand. One per
value is enough to stay complete, and bounds the space by O(n d) (Bessiere, Maestre, Brito and Meseguer, AIJ 161,
2005, Section 3).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from robochoc.model.message import Value
from robochoc.protocols.order import PriorityOrder

LeftSide = Mapping[str, Value]
"""A conjunction of assignments of higher-priority robots; None where a variable of a robot does not matter."""


Explanation = frozenset[str]
"""Keys of constraints and domains (`solver/explanation.py`): a nogood holds as long as all of them stand."""

NOTHING: Explanation = frozenset()


def contradicts(value: Value, other: Value) -> bool:
    """Return whether two views of one robot's value differ in a component that both contain."""
    return any(part != told for part, told in zip(value, other, strict=True) if part is not None and told is not None)


def joined(value: Value | None, other: Value) -> Value:
    """Return the union of two views of one robot's value, which do not contradict each other."""
    if value is None:
        return other
    return tuple([told if part is None else part for part, told in zip(value, other, strict=True)])


class NogoodStore:
    """The left sides of the nogoods that rule out own values, by the value's place in the domain.

    Each has an explanation: the keys of the constraints and domains it was derived from (empty if the protocol keeps
    none).
    """

    def __init__(self, order: PriorityOrder, size: int) -> None:
        self._order = order
        self._by_value: list[LeftSide | None] = [None] * size
        self._because: list[Explanation] = [NOTHING] * size

    def __getitem__(self, index: int) -> LeftSide | None:
        return self._by_value[index]

    def __iter__(self) -> Iterator[LeftSide]:
        return (lhs for lhs in self._by_value if lhs is not None)

    def because(self, index: int) -> Explanation:
        """Return the explanation of the nogood against the value at `index`."""
        return self._because[index]

    def add(self, index: int, lhs: LeftSide, because: Explanation = NOTHING) -> None:
        """Store `lhs` against the value at `index`, unless a better nogood is stored there."""
        present = self._by_value[index]
        if present is None or self._better(lhs, present):
            self._by_value[index] = lhs
            self._because[index] = because

    def forget(self, agent: str, value: Value | None = None) -> None:
        """Drop all nogoods that contain another value of `agent` than `value` (None: any value)."""
        stale = {
            id(lhs) for lhs in self._distinct() if agent in lhs and (value is None or contradicts(lhs[agent], value))
        }
        if stale:
            self._by_value = [None if id(lhs) in stale else lhs for lhs in self._by_value]

    def drop(self, keys: Explanation) -> None:
        """Drop all nogoods that were derived from anything in `keys`."""
        for index, because in enumerate(self._because):
            if not keys.isdisjoint(because):
                self._by_value[index] = None

    def resolve(self) -> dict[str, Value]:
        """Return the union of all left sides: the resolvent, if every value has a nogood."""
        union: dict[str, Value] = {}
        for lhs in self._distinct():
            for agent, value in lhs.items():
                union[agent] = joined(union.get(agent), value)
        return union

    def explanation(self) -> Explanation:
        """Return the union of all explanations, without the own domain."""
        return NOTHING.union(*self._because)

    def _distinct(self) -> Iterable[LeftSide]:
        """Yield each left side once, in the order of the values: many values often share one."""
        return {id(lhs): lhs for lhs in self}.values()

    def _better(self, left: LeftSide, right: LeftSide) -> bool:
        """Return whether `left` has the higher lowest variable (Hirayama and Yokoo 2000), or is shorter."""
        return (self._order.depth(left), len(left)) < (self._order.depth(right), len(right))
