"""Conflicts of all own values at once, for compiled domains of thousands of values.

What `LocalProblem.conflict` finds by walking the constraints for one value, this finds for all values in a few numpy
operations: per constraint a mask over the own domain, per robot (the constraints that look at the same others) the
first constraint that each value breaks, and for a view the first of all, with the checks that a walk would count.
"""

from __future__ import annotations

import itertools
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robochoc.model.message import Value
from robochoc.solver.shared_constraint import OtherValues, SharedConstraint

REMEMBERED = 512
"""Values of a neighbour, for each group of constraints, whose conflicts are kept."""

_Seen = tuple[OtherValues | None, ...]


class _Broken(NamedTuple):
    """For each own value the first constraint of a group that it breaks (their number, if none)."""

    first: NDArray[np.int32]
    constraints: list[tuple[SharedConstraint, OtherValues]]


class _Look(NamedTuple):
    """For each own value what a walk over all constraints would count, and the conflict it would find (-1: none)."""

    checks: list[int]
    broken: list[int]
    constraints: list[tuple[SharedConstraint, OtherValues]]


class ConflictTable:
    """Looks up conflicts of the `size` values of a compiled domain; one view at a time, the last one is kept."""

    def __init__(self, constraints: Sequence[SharedConstraint], size: int) -> None:
        self._size = size
        grouped = [list(group) for _, group in itertools.groupby(constraints, key=lambda c: c.agents)]
        self._groups = [_Group(group) for group in grouped]
        self._firsts = list(itertools.accumulate((len(group) for group in grouped), initial=0))
        self._view: tuple[dict[str, Value], int] | None = None
        self._last = _Look([], [], [])

    def look(self, index: int, view: Mapping[str, Value], first: int = 0) -> tuple[int, SharedConstraint | None]:
        """Return how many constraints are checked for the value at `index`, and which one it breaks in `view`, if any.

        Constraints before the one numbered `first`, which begins a group, are left out.
        """
        if (view, first) != self._view:
            self._view = dict(view), first
            self._last = self._look(view, self._firsts.index(first))
        checks, broken, constraints = self._last
        place = broken[index]
        return checks[index], None if place < 0 else constraints[place][0]

    def _look(self, view: Mapping[str, Value], begin: int) -> _Look:
        checks = np.zeros(self._size, np.int32)
        broken = np.full(self._size, -1, np.int32)
        constraints: list[tuple[SharedConstraint, OtherValues]] = []
        for group in self._groups[begin:]:
            first, known = group.broken(view)
            open_still = broken < 0
            checks += np.where(open_still, np.minimum(first + 1, len(known)), 0)
            hit = open_still & (first < len(known))
            broken[hit] = first[hit] + len(constraints)
            constraints += known
        return _Look(checks.tolist(), broken.tolist(), constraints)


class _Group:
    """Constraints, in the order of checking, that look at the same robots."""

    def __init__(self, constraints: Sequence[SharedConstraint]) -> None:
        self._constraints = constraints
        self._codes = [np.array(constraint.codes, np.int32) for constraint in constraints]
        self._masks: list[dict[OtherValues, NDArray[np.bool_]]] = [{} for _ in constraints]
        self._kept: OrderedDict[_Seen, _Broken] = OrderedDict()

    def broken(self, view: Mapping[str, Value]) -> _Broken:
        """Return the first constraint that each own value breaks, among those that `view` knows enough for."""
        seen = tuple([constraint.other_values(view) for constraint in self._constraints])
        kept = self._kept.get(seen)
        if kept is None:
            kept = self._kept[seen] = self._broken(seen)
            if len(self._kept) > REMEMBERED:
                self._kept.popitem(last=False)
        return kept

    def _broken(self, seen: _Seen) -> _Broken:
        known = [(place, others) for place, others in enumerate(seen) if others is not None]
        first = np.full(len(self._codes[0]), len(known), np.int32)
        for number, (place, others) in reversed(list(enumerate(known))):
            first[~self._mask(place, others)] = number
        return _Broken(first, [(self._constraints[place], others) for place, others in known])

    def _mask(self, place: int, others: OtherValues) -> NDArray[np.bool_]:
        mask = self._masks[place].get(others)
        if mask is None:
            holds = np.array(self._constraints[place].holds(others), np.bool_)
            mask = self._masks[place][others] = holds[self._codes[place]]
        return mask
