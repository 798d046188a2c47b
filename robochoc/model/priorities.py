"""Priorities: the natural order of names, and total orders that respect the links in a team."""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterable, Mapping, Sequence

from robochoc.system.errors import RobochocError


class CycleError(RobochocError, ValueError):
    """Raised if the parents of robots form a cycle. `cycle` lists its robots, each the parent of the next."""

    def __init__(self, cycle: Sequence[str]) -> None:
        super().__init__(" -> ".join((*cycle, cycle[0])))
        self.cycle = tuple(cycle)


def natural_key(name: str) -> tuple[tuple[int, str], ...]:
    """Return a key for natural order: `Robot2.1` before `Robot10.1`. Numbers of any length are compared as text."""
    parts = re.split(r"0*([0-9]+)", name)
    return tuple((len(part) if place % 2 else 0, part) for place, part in enumerate(parts))


def priority_order(parents: Mapping[str, Iterable[str]]) -> tuple[str, ...]:
    """Return a total order of the robots in `parents`: a topological order with ties broken by natural name order.

    Parents that are not keys are ignored.

    Raises:
        CycleError: if no such order exists.
    """
    waiting = {name: {parent for parent in above if parent in parents} for name, above in parents.items()}
    children: dict[str, list[str]] = {name: [] for name in parents}
    for name, above in waiting.items():
        for parent in above:
            children[parent].append(name)
    ready = [(natural_key(name), name) for name, above in waiting.items() if not above]
    heapq.heapify(ready)
    order: list[str] = []
    while ready:
        _, name = heapq.heappop(ready)
        order.append(name)
        for child in children[name]:
            waiting[child].discard(name)
            if not waiting[child]:
                heapq.heappush(ready, (natural_key(child), child))
    if len(order) < len(waiting):
        raise CycleError(_a_cycle({name: above for name, above in waiting.items() if above}))
    return tuple(order)


def _a_cycle(waiting: Mapping[str, set[str]]) -> list[str]:
    """Return a cycle: go up from a robot through parents not yet in the order, until a robot is reached again."""
    walk = [min(waiting, key=natural_key)]
    place = {walk[0]: 0}
    while True:
        above = min((name for name in waiting[walk[-1]] if name in waiting), key=natural_key)
        if above in place:
            return walk[place[above] :][::-1]
        place[above] = len(walk)
        walk.append(above)
