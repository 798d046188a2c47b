"""Random numbers for all families of problems, and the limits of their sizes.

A seed gives the same problem on every machine and with every version of Python: only the methods of `random.Random`
that the Python documentation promises to keep are used, seeding by an integer and `random()`. Costs are drawn as
integers, so nothing is rounded later.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from random import Random

from robochoc.model.cost_units import MAX_PLACES
from robochoc.model.problem import Constraint

MAX_AGENTS = 1000
"""The maximum number of robots, targets or meetings in families that enumerate all their pairs."""
MAX_NODES = 1_000_000
"""The maximum number of robots on a graph."""
MAX_EDGES = 5_000_000
"""The maximum number of constraints on a graph."""
MAX_VALUES = 1000
MAX_COST = 1_000_000
MAX_CONSTRAINTS = 200_000
"""The maximum number of constraints in a team."""


def seeded(seed: int) -> Random:
    """Return a random number generator with the given seed."""
    return Random(seed)  # noqa: S311 - a problem, not a secret


def random_integer(chance: Random, least: int, most: int) -> int:
    """Return a uniformly random integer from `least` to `most`."""
    return least + int(chance.random() * (most - least + 1))


def sample(chance: Random, size: int, count: int) -> list[int]:
    """Return `count` different numbers below `size`, chosen uniformly at random, in ascending order."""
    return sorted(_drawn(chance, size, count))


def _drawn(chance: Random, size: int, count: int) -> Iterator[int]:
    """Yield the first `count` numbers in a Fisher-Yates shuffle of range(size). Only moved numbers are stored."""
    moved: dict[int, int] = {}
    for left in range(size, size - count, -1):
        place = int(chance.random() * left)
        yield moved.get(place, place)
        moved[place] = moved.get(left - 1, left - 1)


def check_bounds(numbers: Mapping[str, tuple[float, float, float]]) -> None:
    """Raise `ValueError` for the first of `numbers` (value, minimum, maximum), by name, that is out of its bounds."""
    for what, (number, least, most) in numbers.items():
        if not least <= number <= most:
            raise ValueError(f"{what} is {number}; it must be from {least} to {most}")


def in_units(number: float, places: int) -> int:
    """Return the decimal `number` in units of 10**-places, rounded with halves to even."""
    return round(Decimal(str(number)).scaleb(places))


def check_places(places: int) -> None:
    """Raise `ValueError` unless `places` is a valid number of decimal places of costs."""
    check_bounds({"places": (places, 0, MAX_PLACES)})


def limited(constraints: Iterable[Constraint]) -> list[Constraint]:
    """Return `constraints` as a list.

    Raises:
        ValueError: There are more than `MAX_CONSTRAINTS`.
    """
    found: list[Constraint] = []
    for constraint in constraints:
        if len(found) == MAX_CONSTRAINTS:
            raise ValueError(f"the team would have more than {MAX_CONSTRAINTS:,} constraints; use smaller numbers")
        found.append(constraint)
    return found
