"""Run-length encoding of lists with one item for each robot, for the first waves of `sfb`.

Teams often have few kinds of robots. So a list with one item for each robot is sent as its distinct items and runs: the
item, and the number of successive robots that have it. A sequence of equal robots then takes a few bytes, whatever its
length. Robots keep the list in this form, too: each robot needs few of its items, and a list for each robot would take
quadratic time and memory in all.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Hashable, Iterable, Sequence
from itertools import accumulate
from typing import Generic, TypeVar

Run = tuple[int, int]
"""The index of an item among the distinct items, and the number of successive robots that have it."""
T = TypeVar("T", bound=Hashable)


def expanded(distinct: Sequence[T], runs: Sequence[Run]) -> list[T]:
    """Return the list in `distinct` and `runs`, which must pass `fits`."""
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


class RunLengths(Generic[T]):
    """A list with one item for each robot, as its `distinct` items and `runs`, which must pass `fits`."""

    def __init__(self, distinct: Sequence[T], runs: Sequence[Run]) -> None:
        self.distinct = distinct
        self.runs = runs
        self._ends = [*accumulate([count for _, count in runs])]

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, place: int) -> T:
        return self.distinct[self.runs[bisect_right(self._ends, place)][0]]

    def counted(self, start: int, stop: int) -> list[tuple[T, int]]:
        """Return the items from place `start` to before `stop`, each with the number of its successive robots."""
        found: list[tuple[T, int]] = []
        at = bisect_right(self._ends, start)
        while start < stop:
            end = min(self._ends[at], stop)
            found.append((self.distinct[self.runs[at][0]], end - start))
            start = end
            at += 1
        return found

    def followed_by(self, distinct: Sequence[T], runs: Sequence[Run]) -> RunLengths[T]:
        """Return this list, then that of `distinct` and `runs`. An item that both have is listed twice."""
        known = len(self.distinct)
        return RunLengths([*self.distinct, *distinct], [*self.runs, *[(known + at, count) for at, count in runs]])


class Columns:
    """The columns of robots in a row: each robot has a number of successive columns, its width.

    `widths` are the widths in priority order, each with the number of its successive robots. `total` is their sum.
    """

    def __init__(self, widths: Iterable[tuple[int, int]]) -> None:
        self.total = 0
        self._places: list[int] = []
        self._starts: list[int] = []
        self._widths: list[int] = []
        place = 0
        for width, count in widths:
            self._places.append(place)
            self._starts.append(self.total)
            self._widths.append(width)
            place += count
            self.total += width * count

    def start(self, place: int) -> int:
        """Return the first column of the robot at this `place`."""
        at = bisect_right(self._places, place) - 1
        return self._starts[at] + (place - self._places[at]) * self._widths[at]


def appended(distinct: Sequence[T], runs: Sequence[Run], item: T) -> tuple[list[T], list[Run]]:
    """Return the distinct items and runs of the list in `distinct` and `runs`, followed by `item`.

    The distinct items remain in the order of their first occurrence, and successive runs differ.
    """
    kinds, longer = [*distinct], [*runs]
    at = kinds.index(item) if item in kinds else len(kinds)
    if at == len(kinds):
        kinds.append(item)
    if longer and longer[-1][0] == at:
        longer[-1] = at, longer[-1][1] + 1
    else:
        longer.append((at, 1))
    return kinds, longer


def prepended(item: T, distinct: Sequence[T], runs: Sequence[Run]) -> tuple[list[T], list[Run]]:
    """Return the distinct items and runs of `item`, followed by the list in `distinct` and `runs`: as in `appended`."""
    at = distinct.index(item) if item in distinct else len(distinct)
    longer = [*runs]
    if at:  # `item` becomes the first one
        longer = [(0 if place == at else place + 1 if place < at else place, count) for place, count in longer]
    if longer and longer[0][0] == 0:
        longer[0] = 0, longer[0][1] + 1
    else:
        longer.insert(0, (0, 1))
    return [item, *distinct[:at], *distinct[at + 1 :]], longer
