"""Run-length encoding of lists with one item for each robot, for the first waves of `sfb`.

Teams often have few kinds of robots. So a list with one item for each robot is sent as its distinct items and runs: the
item, and the number of successive robots that have it. A sequence of equal robots then takes a few bytes, whatever its
length.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from itertools import groupby
from typing import TypeVar

Run = tuple[int, int]
"""The index of an item among the distinct items, and the number of successive robots that have it."""
T = TypeVar("T", bound=Hashable)


def grouped(items: Iterable[T]) -> tuple[list[T], list[Run]]:
    """Return the distinct `items`, in order of first occurrence, and the runs."""
    places: dict[T, int] = {}
    numbers = [places.setdefault(item, len(places)) for item in items]
    return list(places), [(place, len(list(same))) for place, same in groupby(numbers)]


def expanded(distinct: Sequence[T], runs: Sequence[Run]) -> list[T]:
    """Return the list that was passed to `grouped`. The runs must pass `fits`."""
    return [distinct[place] for place, count in runs for _ in range(count)]


def fits(kinds: int, runs: Sequence[Run], robots: int) -> bool:
    """Return whether `runs` over `kinds` distinct items describe exactly `robots` robots."""
    return sum(count for _, count in runs) == robots and all(0 <= at < kinds and count > 0 for at, count in runs)


def cut_off(runs: Iterable[Run], robots: int) -> list[Run]:
    """Return `runs`, cut off after `robots` robots."""
    cut: list[Run] = []
    for place, count in runs:
        taken = max(0, min(count, robots))
        cut.append((place, taken))
        robots -= taken
    return cut
