"""Where drones stand, fly to and step aside: crafts become drones in a box of rows, columns and levels.

Lengths are in cells: a drone is a little narrower than one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

from robochoc.view.crew import Cell, Craft, numbers

Point = tuple[float, float, float]

_GAP = 2
"""Cells between the box and the lines of drones beside it, the first of the line included."""
_TALL = 6
"""Levels that even a single drone's box may have before they are scaled."""
_LEVELS = range(4, 13)
"""Least and most levels of a box whose levels are scaled."""
_TICKS = 15
"""Most labels on an axis."""
_FAR = 1000
"""Positions beyond it are moved to begin at 1: a browser draws in single precision."""
_TOO_CLOSE = 0.5
_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True)
class Drone:
    """Begins at `home`, on the ground. It flies to its `place`, or steps `aside`, or (neither) stays at home."""

    name: str
    group: int
    """Its row: drones of a row look alike."""
    home: Point
    place: Point | None = None
    aside: Point | None = None


@dataclass(frozen=True)
class Axis:
    """One side of the box: the values `first` to `last` lie evenly from cell `low` to cell `high`."""

    name: str
    low: int
    high: int
    first: int
    last: int

    @classmethod
    def over(cls, name: str, values: Iterable[int], *, most: int, scaled: int) -> Axis:
        """The axis that holds `values`: a cell for each of up to `most` numbers, or else `scaled` cells in all."""
        found = [*values] or [1]
        first, last = min(found), max(found)
        if last - first < most:
            low = first if abs(first) < _FAR else 1
            return cls(name, low, low + last - first, first, last)
        return cls(name, 1, scaled, first, last)

    @property
    def cells(self) -> int:
        """How many cells long."""
        return self.high - self.low + 1

    def at(self, value: int) -> float:
        """Where `value` lies."""
        if self.cells == self.last - self.first + 1:
            return float(self.low + value - self.first)
        return self.low + (value - self.first) * (self.high - self.low) / (self.last - self.first)

    @property
    def middle(self) -> float:
        """Half way from end to end."""
        return (self.low + self.high) / 2

    @property
    def ground(self) -> float:
        """One cell below the lowest."""
        return self.low - 1.0

    @property
    def ticks(self) -> list[tuple[float, str]]:
        """Positions to label, and what to write there: round values, not too many."""
        span = self.last - self.first
        step = next(digit * 10**power for power in count() for digit in (1, 2, 5) if span < _TICKS * digit * 10**power)
        return [(self.at(value), str(value)) for value in range(-(-self.first // step) * step, self.last + 1, step)]


@dataclass(frozen=True)
class Layout:
    """Where everything is. The axes are those of x, y and z; the ground is one cell below the lowest level."""

    drones: tuple[Drone, ...]
    axes: tuple[Axis, Axis, Axis]


def lay_out(crew: Sequence[Craft], others: Sequence[Craft] = ()) -> Layout:
    """A place of its own for each of `crew`, in the air and on the ground.

    The axes also reach to the cells and levels of `others`: where some of the crew may be at another time.
    """
    cells = _cells(crew)
    axes = _axes(crew, others, [*cells, *(other.cell for other in others if other.cell)])
    rows, columns, levels = axes
    ground = levels.ground
    beside = _lines(rows.low, rows.cells, columns.high + _GAP, 1)
    withdrawn = sum(craft.withdrew for craft in crew)
    across = min(withdrawn, max(rows.cells, columns.cells) * 3 // 2)
    aside = _lines(rows.middle - (across - 1) / 2, across, columns.low - _GAP, -1)
    homes: list[Point] = []
    places: list[Point] = []
    drones = []
    for craft, (x, y) in zip(crew, cells, strict=True):
        here = (rows.at(x), columns.at(y))
        home = (*here, ground)
        if _near(home, homes):
            home = (*next(beside), ground)
        homes.append(home)
        drone = Drone(craft.name, x, home)
        if craft.level is not None:
            place = (*here, levels.at(craft.level))
            drone = replace(drone, place=_beside(place, _near(place, places)))
            places.append(place)
        elif craft.withdrew:
            drone = replace(drone, aside=(*next(aside), ground))
        drones.append(drone)
    return Layout(tuple(drones), axes)


def _cells(crew: Sequence[Craft]) -> list[Cell]:
    """The crafts' cells; those that have none get a square grid, behind the others if there are others."""
    known = [craft.cell for craft in crew if craft.cell]
    side = math.ceil(math.sqrt(len(crew) - len(known)))
    x = min((x for x, _ in known), default=1)
    y = max((y + _GAP for _, y in known), default=1)
    grid = ((x + row, y + column) for row in range(side) for column in range(side))
    return [craft.cell or next(grid) for craft in crew]


def _axes(crew: Sequence[Craft], others: Sequence[Craft], cells: Sequence[Cell]) -> tuple[Axis, Axis, Axis]:
    most = max(_LEVELS[-1], 3 * math.ceil(math.sqrt(len(crew))))
    names = _axis_names(crew)
    rows = Axis.over(names[0], (x for x, _ in cells), most=most, scaled=most)
    columns = Axis.over(names[1], (y for _, y in cells), most=most, scaled=most)
    side = max(rows.cells, columns.cells)
    values = [craft.level for craft in (*crew, *others) if craft.level is not None]
    if all(1 <= value <= side for value in values):
        return rows, columns, Axis(names[2], 1, side, 1, side)
    scaled = min(max(side, _LEVELS[0]), _LEVELS[-1])
    return rows, columns, Axis.over(names[2], values, most=max(_TALL, 2 * side), scaled=scaled)


def _axis_names(crew: Sequence[Craft]) -> tuple[str, str, str]:
    if all(craft.cell and craft.cell == numbers(craft.name) for craft in crew):
        return "row", "column", "level"
    return ("x", "y", "z") if any(craft.cell for craft in crew) else ("", "", "value")


def _lines(x: float, across: int, y: int, step: int) -> Iterator[tuple[float, float]]:
    """Spots beside the box: lines of `across`, the first at `y`, each from `x` on, the next `step` behind it."""
    for number in count():
        yield float(x + number % across), float(y + number // across * step)


def _near(point: Point, others: Sequence[Point]) -> int:
    """How many of `others` would be drawn into `point`."""
    return sum(math.dist(point, other) < _TOO_CLOSE for other in others)


def _beside(point: Point, number: int) -> Point:
    """The point itself for the first to come there; newcomers spiral outwards, like a sunflower's seeds."""
    x, y, z = point
    turn, radius = number * _GOLDEN_ANGLE, 0.3 * math.sqrt(number)
    return (x + radius * math.cos(turn), y + radius * math.sin(turn), z)
