"""Nogoods, and the store that keeps at most one nogood for each value in a robot's domain.

A nogood `lhs => x_i != v` means that x_i cannot take v while all assignments in its left side hold. One nogood for each
value is enough for completeness, and bounds the space by O(n d) (Bessiere, Maestre, Brito and Meseguer, AIJ 161, 2005,
Section 3).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder

LeftSide = Mapping[str, Value]
"""A conjunction of assignments of higher-priority robots; None if a variable of a robot does not matter."""


Explanation = frozenset[str]
"""Keys of constraints and domains (`solver/explanation.py`): a nogood is valid as long as all of these are."""

NO_EXPLANATION: Explanation = frozenset()


def contradicts(value: Value, other: Value) -> bool:
    """Return whether two views of one robot's value differ in a component that both contain."""
    if value == other:
        return False
    for part, known in zip(value, other, strict=True):  # twice as fast as a generator expression
        if part != known and part is not None and known is not None:
            return True
    return False


def joined(value: Value | None, other: Value) -> Value:
    """Return the union of two views of one robot's value, which do not contradict each other."""
    if value is None or value == other:
        return other
    return tuple([known if part is None else part for part, known in zip(value, other, strict=True)])


class NogoodStore:
    """The left sides of the nogoods that rule out this robot's values, by the value's index in the domain.

    Each left side has an explanation: the keys of the constraints and domains from which it was derived (empty if the
    protocol keeps none). Many values often share one left side. Left sides are indexed by their robots, so a new value
    of a robot only costs time for the nogoods that contain this robot. `open` is the number of values that no nogood
    rules out.
    """

    def __init__(self, order: PriorityOrder, size: int) -> None:
        self.open = size
        self._order = order
        self._by_value: list[LeftSide | None] = [None] * size
        self._because: list[Explanation] = [NO_EXPLANATION] * size
        self._places: dict[int, set[int]] = {}
        """The values that a left side rules out, by its `id`."""
        self._naming: dict[str, dict[int, LeftSide]] = {}
        """The left sides that contain a robot, by their `id`."""

    def __getstate__(self) -> tuple[PriorityOrder, list[LeftSide | None], list[Explanation]]:
        """Return the content of the store, for copies: in a copy, left sides have other `id`s."""
        pairs = zip(self._by_value, self._because, strict=True)
        return self._order, self._by_value, [NO_EXPLANATION if lhs is None else because for lhs, because in pairs]

    def __setstate__(self, state: tuple[PriorityOrder, list[LeftSide | None], list[Explanation]]) -> None:
        order, by_value, because = state
        self.__init__(order, len(by_value))  # type: ignore[misc]
        for index, lhs in enumerate(by_value):
            if lhs is not None:
                self.add(index, lhs, because[index])

    def __getitem__(self, index: int) -> LeftSide | None:
        return self._by_value[index]

    def __iter__(self) -> Iterator[LeftSide]:
        return iter([lhs for lhs in self._by_value if lhs is not None])

    def because(self, index: int) -> Explanation:
        """Return the explanation of the nogood against the value at `index`."""
        return self._because[index]

    def first_open(self, index: int = 0) -> int | None:
        """Return the first value from `index` on that no nogood rules out; None if there is none."""
        if not self.open:
            return None
        try:
            return self._by_value.index(None, index)
        except ValueError:
            return None

    def all_open(self) -> list[int]:
        """Return all values that no nogood rules out."""
        if not self.open:
            return []
        return [index for index, lhs in enumerate(self._by_value) if lhs is None]

    def add(self, index: int, lhs: LeftSide, because: Explanation = NO_EXPLANATION) -> None:
        """Store `lhs` against the value at `index`, unless a better nogood is stored there."""
        present = self._by_value[index]
        if present is not None:
            if not self._better(lhs, present):
                return
            self._remove(index, present)
        self.open -= 1
        self._by_value[index] = lhs
        self._because[index] = because
        places = self._places.get(id(lhs))
        if places is None:
            self._index(lhs, [index])
        else:
            places.add(index)

    def rule_out(self, indices: Sequence[int], lhs: LeftSide) -> None:
        """Store `lhs` against the values at `indices`, which are open."""
        self.open -= len(indices)
        for index in indices:
            self._by_value[index] = lhs
        places = self._places.get(id(lhs))
        if places is None:
            self._index(lhs, indices)
        else:
            places.update(indices)

    def forget(self, agent: str, value: Value | None = None) -> None:
        """Drop all nogoods that contain a value of `agent` other than `value` (None: any value)."""
        named = self._naming.get(agent)
        if named:
            self._drop([lhs for lhs in named.values() if value is None or contradicts(lhs[agent], value)])

    def forget_others(
        self, assignments: Sequence[tuple[Value, int]], places: Mapping[str, int], first: int = 0
    ) -> None:
        """Drop all nogoods that contain a value that is not in `assignments`, or a robot that is not in them.

        `places` are the robots' indices in `assignments`; the assignments before `first` are known to be unchanged.
        """
        stale: dict[int, LeftSide] = {}
        size = len(assignments)
        for agent, named in self._naming.items():
            place = places[agent]
            if place >= size:
                stale.update(named)
            elif place >= first:
                value = assignments[place][0]
                stale |= {key: lhs for key, lhs in named.items() if contradicts(lhs[agent], value)}
        if stale:
            self._drop(stale.values())

    def drop(self, keys: Explanation) -> None:
        """Drop all nogoods that were derived from anything in `keys`."""
        for index, because in enumerate(self._because):
            lhs = self._by_value[index]
            if lhs is not None and not keys.isdisjoint(because):
                self._remove(index, lhs)

    def resolve(self) -> dict[str, Value]:
        """Return the union of all left sides, which is the resolvent if every value has a nogood."""
        union: dict[str, Value] = {}
        for lhs in self._distinct():
            for agent, value in lhs.items():
                union[agent] = joined(union.get(agent), value)
        return union

    def explanation(self) -> Explanation:
        """Return the union of all explanations, without this robot's domain."""
        return NO_EXPLANATION.union(*self._because)

    def _distinct(self) -> Iterable[LeftSide]:
        """Yield each left side once, in the order of the values."""
        return {id(lhs): lhs for lhs in self._by_value if lhs is not None}.values()

    def _drop(self, stale: Iterable[LeftSide]) -> None:
        """Drop the nogoods with these left sides."""
        for lhs in stale:
            places = self._places.pop(id(lhs))
            for place in places:
                self._by_value[place] = None
            self.open += len(places)
            self._unindex(lhs)

    def _remove(self, index: int, lhs: LeftSide) -> None:
        """Drop the nogood with this left side against the value at `index`."""
        self._by_value[index] = None
        self.open += 1
        places = self._places[id(lhs)]
        places.remove(index)
        if not places:
            del self._places[id(lhs)]
            self._unindex(lhs)

    def _index(self, lhs: LeftSide, indices: Iterable[int]) -> None:
        """Add a new left side, with the values that it rules out."""
        key = id(lhs)
        self._places[key] = set(indices)
        for agent in lhs:
            named = self._naming.get(agent)
            if named is None:
                self._naming[agent] = {key: lhs}
            else:
                named[key] = lhs

    def _unindex(self, lhs: LeftSide) -> None:
        key = id(lhs)
        for agent in lhs:
            named = self._naming[agent]
            if len(named) == 1:
                del self._naming[agent]
            else:
                del named[key]

    def _better(self, left: LeftSide, right: LeftSide) -> bool:
        """Return whether `left` has the higher lowest variable (Hirayama and Yokoo 2000), or is shorter."""
        if left is right:
            return False
        return (self._order.depth(left), len(left)) < (self._order.depth(right), len(right))
