"""Several objectives: the ways to combine them into a single cost, and their costs as one number.

The costs in two or three objectives form a vector. Vectors are added up and compared as single integers: `pack` writes
a vector in a number system with mixed bases, each base above the largest sum in its objective, so that the sum of
packed vectors is the packed sum. The order of packed vectors is the lexicographic order.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterable, Sequence
from enum import StrEnum
from math import inf

from robochoc.system.lazy_dataclass import dataclass

MOST_WEIGHT = 10**9
"""The largest weight of an objective."""
EXPECTED = "weighted:NAME=WEIGHT,..., lexicographic:NAME,... or pareto"


class Combination(StrEnum):
    """The meaning of an optimum: a minimum weighted sum, a lexicographic minimum, or the Pareto front."""

    WEIGHTED = "weighted"
    LEXICOGRAPHIC = "lexicographic"
    PARETO = "pareto"


@dataclass(frozen=True)
class ObjectivesMode:
    """The treatment of several objectives.

    Attributes:
        combination: The meaning of an optimum.
        weights: The weight of each objective, positive integers, for `WEIGHTED`.
        order: The objectives, the most important first, for `LEXICOGRAPHIC`.
    """

    combination: Combination
    weights: tuple[tuple[str, int], ...] = ()
    order: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return the text that `objectives_mode` reads."""
        listed = ",".join([*(f"{name}={weight}" for name, weight in self.weights), *self.order])
        return f"{self.combination}:{listed}" if listed else str(self.combination)

    @property
    def names(self) -> tuple[str, ...]:
        """The objectives that are named. None are named for `PARETO`."""
        return self.order or tuple(name for name, _ in self.weights)


PARETO = ObjectivesMode(Combination.PARETO)


def objectives_mode(text: str) -> ObjectivesMode:
    """Return the mode in `text`: `weighted:energy=1,risk=3`, `lexicographic:energy,risk` or `pareto`.

    Raises:
        ValueError: if the text has another form.
    """
    kind, colon, listed = text.partition(":")
    if kind not in set(Combination):
        raise ValueError(f"{text[:60]!r} is not a way to combine objectives: expected {EXPECTED}")
    parts = [part.strip() for part in listed.split(",")] if colon else []
    if kind == Combination.PARETO:
        if colon:
            raise ValueError(f"{text[:60]!r} names objectives, and pareto has all of them: write pareto")
        return PARETO
    names = [part.partition("=")[0].strip() for part in parts]
    if not all(names) or not names:
        raise ValueError(f"{text[:60]!r} names no objective: expected {EXPECTED}")
    if len({*names}) < len(names):
        raise ValueError(f"{text[:60]!r} names an objective twice: name each once")
    if kind == Combination.WEIGHTED:
        return ObjectivesMode(Combination.WEIGHTED, weights=tuple(map(_weight, names, parts)))
    if any("=" in part for part in parts):
        raise ValueError(
            f"{text[:60]!r} has weights, and lexicographic has none: write lexicographic:{','.join(names)}"
        )
    return ObjectivesMode(Combination.LEXICOGRAPHIC, order=tuple(names))


def _weight(name: str, part: str) -> tuple[str, int]:
    digits = part.partition("=")[2].strip()
    if not digits.isascii() or not digits.isdecimal() or not 1 <= int(digits[:11]) <= MOST_WEIGHT:
        message = f"the weight of {name[:60]} is {digits[:20] or 'missing'}"
        raise ValueError(f"{message}: write {name[:60]}=WEIGHT, an integer from 1 to {MOST_WEIGHT:,}")
    return name, int(digits)


# Packed vectors


def place_values(bases: Sequence[int]) -> tuple[int, ...]:
    """Return the factor of each component in a packed vector, for the `bases` of all components but the first."""
    factors = [1]
    for base in reversed(bases):
        factors.append(factors[-1] * base)
    return tuple(reversed(factors))


def unpacked(packed: int, bases: Sequence[int]) -> tuple[int, ...]:
    """Return the vector in a packed number."""
    components = []
    for base in reversed(bases):
        packed, component = divmod(packed, base)
        components.append(component)
    return (packed, *reversed(components))


def non_dominated(packed: Iterable[int], bases: Sequence[int]) -> list[int]:
    """Return the distinct packed vectors that no other one dominates, in ascending (lexicographic) order.

    A vector dominates another if it is less in some component and greater in none.
    """
    ascending = sorted({*packed})
    match bases:
        case ():
            return ascending[:1]
        case (base,):
            least: float = inf
            found = []
            for one in ascending:
                if one % base < least:
                    least = one % base
                    found.append(one)
            return found
        case (second, third):
            return _staircase(ascending, second, third)
        case _:
            raise ValueError(f"{len(bases) + 1} objectives are not supported")


def _staircase(ascending: Iterable[int], second: int, third: int) -> list[int]:
    """Return the non-dominated vectors of three components.

    `steps` are the second and third components of the vectors so far that no other one dominates in these: their second
    components ascend, and their third components descend.
    """
    steps: list[tuple[int, int]] = []
    found = []
    for one in ascending:
        rest = one % (second * third)
        step = rest // third, rest % third
        place = bisect_right(steps, step)
        if place and steps[place - 1][1] <= step[1]:
            continue
        found.append(one)
        last = place
        while last < len(steps) and steps[last][1] >= step[1]:
            last += 1
        del steps[place:last]
        insort(steps, step)
    return found


def added(fronts: Iterable[Sequence[int]], bases: Sequence[int], most: int) -> list[int] | None:
    """Return the non-dominated sums of one packed vector from each of `fronts`; None after `most` additions."""
    total = [0]
    spent = 0
    for front in fronts:
        spent += len(total) * len(front)
        if spent > most:
            return None
        total = non_dominated([one + other for one in total for other in front], bases)
    return total
