"""Computes the conflicts of all values of this robot at once, for compiled domains with thousands of values.

`LocalProblem.conflict` checks the constraints for one value. Here a few numpy operations handle all values: they
compute a mask over this robot's domain for each constraint, then the first constraint that each value violates for each
group of constraints with the same robots, and then, for a view, the first violated constraint of all, with the same
number of checks as `LocalProblem.conflict`.
"""

from __future__ import annotations

import itertools
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robochoc.model.problem import Value
from robochoc.solver.shared_constraint import OtherValues, SharedConstraint

MAX_CACHED = 512
"""The maximum number of cached conflicts, by values of neighbours, for each group of constraints."""

_Seen = tuple[OtherValues | None, ...]


class _Broken(NamedTuple):
    """For each own value, the first constraint in a group that it violates (the number of constraints, if none)."""

    first: NDArray[np.int32]
    constraints: list[tuple[SharedConstraint, OtherValues]]


class _BrokenConstraints(NamedTuple):
    """For each own value, the number of checks and the first violated constraint (-1: none)."""

    checks: list[int]
    broken: list[int]
    constraints: list[tuple[SharedConstraint, OtherValues]]


class ConflictTable:
    """Looks up the conflicts of the `size` values in a compiled domain; caches the conflicts for the last view."""

    def __init__(self, constraints: Sequence[SharedConstraint], size: int) -> None:
        self._size = size
        grouped = [list(group) for _, group in itertools.groupby(constraints, key=lambda c: c.agents)]
        self._groups = [_ConstraintGroup(group) for group in grouped]
        self._firsts = list(itertools.accumulate((len(group) for group in grouped), initial=0))
        self._view: tuple[dict[str, Value], int] | None = None
        self._last = _BrokenConstraints([], [], [])

    def first_broken(
        self, index: int, view: Mapping[str, Value], first: int = 0
    ) -> tuple[int, SharedConstraint | None]:
        """Return the number of checks for the value at `index`, and the constraint that it violates in `view`, if any.

        Constraints with numbers below `first`, the first constraint of a group, are skipped.
        """
        if (view, first) != self._view:
            self._view = dict(view), first
            self._last = self._compute(view, self._firsts.index(first))
        checks, broken, constraints = self._last
        place = broken[index]
        return checks[index], None if place < 0 else constraints[place][0]

    def _compute(self, view: Mapping[str, Value], begin: int) -> _BrokenConstraints:
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
        return _BrokenConstraints(checks.tolist(), broken.tolist(), constraints)


class _ConstraintGroup:
    """Constraints with the same robots, in the order in which they are checked."""

    def __init__(self, constraints: Sequence[SharedConstraint]) -> None:
        self._constraints = constraints
        self._codes = [np.array(constraint.codes, np.int32) for constraint in constraints]
        self._masks: list[dict[OtherValues, NDArray[np.bool_]]] = [{} for _ in constraints]
        self._cache: OrderedDict[_Seen, _Broken] = OrderedDict()

    def broken(self, view: Mapping[str, Value]) -> _Broken:
        """For each own value, return the first violated constraint without unknown variables in `view`."""
        seen = tuple([constraint.other_values(view) for constraint in self._constraints])
        kept = self._cache.get(seen)
        if kept is None:
            kept = self._cache[seen] = self._broken(seen)
            if len(self._cache) > MAX_CACHED:
                self._cache.popitem(last=False)
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
