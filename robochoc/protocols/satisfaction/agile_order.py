"""Orders of Agile-ABT: explanations, termination vectors, and the search for a smaller order at a dead end.

Bessiere, Bouyakhf, Mechqrane, Wahbi: "Agile asynchronous backtracking for distributed constraint satisfaction
problems", ICTAI 2011. Pure functions; the protocol is in `agile_abt.py`.

An explanation contains the number of values that a robot's nogoods leave it, and the condition of these nogoods: all
robots in their left sides have higher priority. A termination vector lists the number of remaining values of each
robot, in the order of the robots; vectors are compared lexicographically.

In this example R3 is below R1 and R2 and has no value left. It finds that R1 = 1 and R2 = 4 cannot both stay. R2 may
change its value in the current order, R1 only if it moves below R2:

>>> names = ("R1", "R2", "R3", "R4")
>>> sizes = {"R1": 3, "R2": 3, "R3": 3, "R4": 5}
>>> proposed(names, "R2", {"R1": (1,)}, {"R3": Explanation({"R1": (1,)}, 2)}, sizes)
Proposal(culprit='R2', names=('R1', 'R2', 'R3', 'R4'), termination=(3, 2, 2, 5))
>>> proposed(names, "R1", {"R2": (4,)}, {"R3": Explanation({"R2": (4,)}, 1)}, sizes)
Proposal(culprit='R1', names=('R2', 'R3', 'R1', 'R4'), termination=(3, 1, 2, 5))
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.nogood import LeftSide

UNKNOWN = 2**31 - 1
"""The number of remaining values of a robot whose domain size is unknown."""

TerminationVector = tuple[int, ...]
"""TV: the numbers of remaining values of the first robot in an order, the second, and so on."""


class Explanation(NamedTuple):
    """The union of the left sides of a robot's nogoods, and the number of its values without a nogood."""

    lhs: Mapping[str, Value]
    left: int


Explanations = Mapping[str, Explanation]
"""E: the last explanation of each robot that has one."""


class Proposal(NamedTuple):
    """An order in which `culprit` may be sent a nogood, and the order's termination vector."""

    culprit: str
    names: tuple[str, ...]
    termination: TerminationVector


def compatible(order: PriorityOrder, name: str, lhs: Iterable[str]) -> bool:
    """Return whether all robots of the left side `lhs` have higher priority than `name` in `order`."""
    return order.depth(lhs) < order.rank[name]


def updated(
    explanations: Explanations, culprit: str, lhs: LeftSide, sizes: Mapping[str, int]
) -> dict[str, Explanation]:
    """Return the explanations after `culprit` has received a nogood with the left side `lhs` (UpdateExplanations).

    `culprit` will change its value, so explanations that contain it are removed. It has one value fewer, and must come
    after all robots in `lhs`.
    """
    kept = {name: one for name, one in explanations.items() if culprit not in one.lhs}
    before = kept.get(culprit) or Explanation({}, sizes.get(culprit, UNKNOWN))
    left = UNKNOWN if before.left == UNKNOWN else max(before.left - 1, 0)
    kept[culprit] = Explanation({**before.lhs, **lhs}, left)
    return kept


def ordered(names: Sequence[str], explanations: Explanations, left: Mapping[str, int]) -> tuple[str, ...]:
    """Return an order compatible with all `explanations`, which must not be circular (ComputeOrder).

    Among the robots that may come next, the one with the fewest remaining values is next; ties go to the first in
    `names`.
    """
    place = {name: number for number, name in enumerate(names)}
    below: dict[str, list[str]] = {name: [] for name in names}
    awaited = dict.fromkeys(names, 0)
    for name, explanation in explanations.items():
        awaited[name] = len(explanation.lhs)
        for above in explanation.lhs:
            below[above].append(name)
    ready = [(left[name], place[name]) for name in names if not awaited[name]]
    heapq.heapify(ready)
    result = []
    while ready:
        name = names[heapq.heappop(ready)[1]]
        result.append(name)
        for lower in below[name]:
            awaited[lower] -= 1
            if not awaited[lower]:
                heapq.heappush(ready, (left[lower], place[lower]))
    return tuple(result)


def proposed(
    names: Sequence[str], culprit: str, lhs: LeftSide, explanations: Explanations, sizes: Mapping[str, int]
) -> Proposal:
    """Return the order for a nogood: `culprit` cannot keep its value while `lhs` holds.

    All `explanations` are compatible with the order `names`, so they are not circular. The updated ones are not
    circular either: no explanation contains `culprit` any more, so placing it after `lhs` closes no cycle.
    """
    after = updated(explanations, culprit, lhs, sizes)
    left = {name: after[name].left if name in after else sizes.get(name, UNKNOWN) for name in names}
    result = ordered(names, after, left)
    return Proposal(culprit, result, tuple([left[name] for name in result]))
