"""Nogoods and the store that keeps at most one for each value of the own domain.

A nogood `lhs => x_i != v` says that x_i cannot take v while all assignments of its left side stand. One per
value is enough to stay complete, and bounds the space by O(n d) (Bessiere, Maestre, Brito and Meseguer, AIJ 161,
2005, Section 3).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from robochoc.message import Value
from robochoc.protocols.order import PriorityOrder

LeftSide = Mapping[str, Value]
"""A conjunction of assignments of higher-priority robots."""


class NogoodStore:
    """The left sides of the nogoods that rule out own values, by the value's place in the domain."""

    def __init__(self, order: PriorityOrder, size: int) -> None:
        self._order = order
        self._by_value: list[LeftSide | None] = [None] * size

    def __getitem__(self, index: int) -> LeftSide | None:
        return self._by_value[index]

    def __iter__(self) -> Iterator[LeftSide]:
        return (lhs for lhs in self._by_value if lhs is not None)

    def add(self, index: int, lhs: LeftSide) -> None:
        """Store `lhs` against the value at `index`, unless the nogood that is there already is better."""
        present = self._by_value[index]
        if present is None or self._better(lhs, present):
            self._by_value[index] = lhs

    def forget(self, agent: str, value: Value | None = None) -> None:
        """Drop every nogood that rests on another value of `agent` than `value` (None: on any)."""
        for index, lhs in enumerate(self._by_value):
            if lhs is not None and lhs.get(agent, value) != value:
                self._by_value[index] = None

    def resolve(self) -> dict[str, Value]:
        """The union of all left sides: what rules out the whole domain when every value has a nogood."""
        return {agent: value for lhs in self for agent, value in lhs.items()}

    def _better(self, left: LeftSide, right: LeftSide) -> bool:
        """Highest possible lowest variable (Hirayama and Yokoo 2000); between equals, the shorter one."""
        return (self._order.depth(left), len(left)) < (self._order.depth(right), len(right))
