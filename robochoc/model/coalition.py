"""The coalitions that can do a task: sets of robots that fill all places of a team, each robot at most one.

A coalition with as many robots as places fills them if, for each set of skills, it has at least as many robots with one
of these skills as there are places for them (Hall, J. London Math. Soc. 10, 1935). Robots that can fill the same places
are of the same kind: whether a coalition is complete depends only on the number of its robots of each kind.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from math import prod
from typing import NamedTuple

Kind = frozenset[str]
"""The skills of a team that a robot has."""


class Coalitions(NamedTuple):
    """The complete coalitions, as sums: the sum of the weights of their robots is different for each combination.

    Attributes:
        weights: The weight of each robot.
        sums: The sums of the complete coalitions, in ascending order.
    """

    weights: tuple[int, ...]
    sums: tuple[int, ...]


def coalitions(kinds: Sequence[Kind], places: Mapping[str, int], size: int) -> Coalitions:
    """Return the coalitions of `size` robots that fill all places.

    Args:
        kinds: The kind of each robot.
        places: The number of places for each skill. Empty: each robot can fill each place.
        size: The number of places.
    """
    different = sorted({*kinds}, key=sorted)
    numbers = [kinds.count(kind) for kind in different]
    weights = {kind: prod(number + 1 for number in numbers[:place]) for place, kind in enumerate(different)}
    sums = {
        sum(count * weights[kind] for count, kind in zip(counts, different, strict=True))
        for counts in itertools.product(*(range(min(number, size) + 1) for number in numbers))
        if sum(counts) == size and _fill(dict(zip(different, counts, strict=True)), places)
    }
    return Coalitions(tuple(weights[kind] for kind in kinds), tuple(sorted(sums)))


def can_fill(kinds: Sequence[Kind], places: Mapping[str, int], size: int) -> bool:
    """Return whether some of these robots fill all places; the arguments are those of `coalitions`."""
    return len(kinds) >= size and _fill({kind: kinds.count(kind) for kind in kinds}, places)


def _fill(counts: Mapping[Kind, int], places: Mapping[str, int]) -> bool:
    sets = (skills for number in range(1, len(places) + 1) for skills in itertools.combinations(places, number))
    return all(
        sum(count for kind, count in counts.items() if not kind.isdisjoint(skills)) >= sum(places[s] for s in skills)
        for skills in sets
    )
