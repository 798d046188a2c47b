"""The groups of robots around a centre, and their best joint moves: the computations of k-opt (see `kopt.py`).

A region is what a centre knows: the domain sizes and charges of the robots around it, and the cost tables of their
constraints. Broken hard constraints are counted apart from costs, so that nothing infinite is ever subtracted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robochoc.protocols.local_search.messages.kopt import Part, Table
from robochoc.protocols.shared.cycles import gain
from robochoc.solver.compiled import LexicographicCost
from robochoc.solver.encoding import TooLargeError

MOST_COMBINATIONS = 1 << 20
"""Of the values of a group. Groups with more would take gigabytes and minutes."""
MOST_GROUPS = 20_000
_LARGEST = np.iinfo(np.int64).max

Counts = NDArray[np.int64]
Group = tuple[str, ...]
"""In priority order."""


class Burdens(NamedTuple):
    """The costs of a constraint, with an axis for each robot of `scope`: broken hard constraints, and the cost else."""

    scope: Group
    broken: Counts
    cost: Counts

    def seen_by(self, group: Group, sizes: Mapping[str, int], view: Mapping[str, int]) -> tuple[Counts, Counts]:
        """Return the costs with an axis for each robot of `group`; all others have their values of `view`."""
        index = tuple(slice(None) if name in group else view[name] for name in self.scope)
        shape = [sizes[name] if name in self.scope else 1 for name in group]
        return self.broken[index].reshape(shape), self.cost[index].reshape(shape)


class Move(NamedTuple):
    """A joint move: its gain, and the places of the new values of those who move."""

    gain: LexicographicCost
    moves: dict[str, int]


class Neighbourhood:
    """The problem of the robots around a centre, and the groups that the centre may lead.

    `groups` are the largest connected ones of at most `k` robots, itself among them, that are at most `radius` links
    away. Smaller ones are contained in them, as robots of a group may keep their values.
    """

    def __init__(self, centre: str, parts: Mapping[str, Part], rank: Mapping[str, int], k: int, radius: int) -> None:
        self._centre = centre
        self._rank = rank
        self.sizes = {name: len(part.charges) for name, part in parts.items()}
        self._on: dict[str, list[Burdens]] = {name: [] for name in parts}
        for name, part in parts.items():
            self._add(_burdens((name,), part.charges, self.sizes))
            for table in part.tables:
                self._add(self._checked(name, table))
        self._within = self._reached(radius)
        self.groups = self._connected(k)

    def _checked(self, owner: str, table: Table) -> Burdens | None:
        """Return the costs of a constraint; None if it reaches further than this region."""
        scope = tuple(table.scope)
        if scope[:1] != (owner,) or len(set(scope)) < len(scope):
            raise ValueError(f"{owner} tells of a constraint that is not its own")
        return _burdens(scope, table.costs, self.sizes) if all(name in self.sizes for name in scope) else None

    def _add(self, burdens: Burdens | None) -> None:
        if burdens is not None:
            for name in burdens.scope:
                self._on[name].append(burdens)

    def touched(self, group: Iterable[str]) -> dict[str, None]:
        """Return the robots of a group and all that share a constraint with them, in a fixed order."""
        return {name: None for member in group for burdens in self._on[member] for name in burdens.scope}

    def _reached(self, radius: int) -> dict[str, None]:
        """Return the robots at most `radius` links away, the centre first."""
        found = {self._centre: None}
        for _ in range(radius):
            found |= self.touched(found)
        return found

    def _connected(self, k: int) -> list[Group]:
        """Return the connected groups of `k` robots, or of all if there are fewer."""
        groups: dict[Group, None] = {(self._centre,): None}
        for _ in range(k - 1):
            larger: dict[Group, None] = {}
            for group in groups:
                others = [name for name in self.touched(group) if name in self._within and name not in group]
                larger |= {tuple(sorted((*group, name), key=self._rank.__getitem__)): None for name in others}
                if len(larger) > MOST_GROUPS:
                    raise TooLargeError(
                        f"{self._centre} is in more than {MOST_GROUPS:,} groups of {k} robots (--set k=NUMBER)"
                    )
            groups = larger or groups
        return [self._fitting(group) for group in groups]

    def _fitting(self, group: Group) -> Group:
        """Return a group; raise `TooLargeError` if its values have too many combinations."""
        if math.prod(self.sizes[name] for name in group) > MOST_COMBINATIONS:
            raise TooLargeError(
                f"{len(group)} robots around {self._centre} have more than {MOST_COMBINATIONS:,} combinations of values"
                " (--set k=NUMBER)"
            )
        return group

    def best(self, view: Mapping[str, int]) -> Move:
        """Return the move of a group that gains most; of several that of the fewest robots, then the first one."""
        moves = (self.best_of(group, view) for group in self.groups)
        return max(moves, key=lambda move: (move.gain, -len(move.moves)))

    def best_of(self, group: Group, view: Mapping[str, int]) -> Move:
        """Return the best move of one group, where all others keep their values."""
        shape = [self.sizes[name] for name in group]
        broken, cost = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
        for burdens in {id(one): one for member in group for one in self._on[member]}.values():
            more_broken, more_cost = burdens.seen_by(group, self.sizes, view)
            broken += more_broken
            cost += more_cost
        now = tuple(view[name] for name in group)
        ranked = np.where(broken == broken.min(), cost, _LARGEST)
        best = np.unravel_index(int(np.where(ranked == ranked.min(), _moving(shape, now), _LARGEST).argmin()), shape)
        before, after = ((int(broken[place]), int(cost[place])) for place in (now, best))
        if after >= before:
            return Move((0, 0), {})
        changed = {name: int(new) for name, old, new in zip(group, now, best, strict=True) if new != old}
        return Move(gain(before, after), changed)


def _moving(shape: Sequence[int], now: Sequence[int]) -> Counts:
    """Return how many robots move, for each combination of values."""
    moving = np.zeros(shape, np.int64)
    for axis, (size, place) in enumerate(zip(shape, now, strict=True)):
        others = [1] * len(shape)
        others[axis] = size
        moving += (np.arange(size) != place).reshape(others)
    return moving


def _burdens(scope: Group, costs: Sequence[float], sizes: Mapping[str, int]) -> Burdens:
    """Return costs that were told as a list; raise `ValueError` if they cannot be those of `scope`."""
    shape = [sizes[name] for name in scope]
    if len(costs) != math.prod(shape) or not all(cost >= 0 for cost in costs):
        raise ValueError(f"costs of {', '.join(scope)} that cannot be")
    broken = np.array([cost == math.inf for cost in costs], np.int64).reshape(shape)
    return Burdens(
        scope, broken, np.array([0 if cost == math.inf else cost for cost in costs], np.int64).reshape(shape)
    )
