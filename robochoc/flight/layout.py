"""The layout of a mission: homes, goals and landing points of drones, in a box of rows, columns and levels.

Lengths are in cells. A drone is a little narrower than a cell. An axis maps values of the problem to cells.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import count, product

from robochoc.flight.crafts import Cell, Craft, row_and_column
from robochoc.maps.ground_map import GroundMap
from robochoc.system.lazy_dataclass import dataclass

Point = tuple[float, float, float]

_GAP = 2
"""The distance from the box to the first line of drones beside it, in cells."""
_TALL = 6
"""The maximum number of levels in an unscaled box, even for a single drone."""
_LEVELS = range(4, 13)
"""The possible numbers of levels in a box with scaled levels."""
_TICKS = 15
"""The maximum number of labels on an axis."""
_LEAST_POWER = -3
"""The smallest step between labels in metres, as a power of ten."""
_FAR = 1000
"""Axes with a larger first value are moved to begin at 1, since browsers draw in single precision."""
_PLACE = ("x", "y", "z")
_TOO_CLOSE = 0.5
"""Places nearer to each other than this count as the same place."""
_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True)
class BoxAxis:
    """An axis of the box, which spreads the values `first` to `last` evenly over the cells `low` to `high`.

    On a map whose units have a length, `unit_m`, the axis is labelled in metres of the map's frame.
    """

    name: str
    low: int
    high: int
    first: int
    last: int
    unit_m: float | None = None

    @classmethod
    def spanning(cls, name: str, values: Iterable[float], *, most: int, scaled: int) -> BoxAxis:
        """Return an axis for `values`: one cell per number if there are at most `most`, else `scaled` cells."""
        found = [*values] or [1]
        first, last = math.floor(min(found)), math.ceil(max(found))
        if last - first < most:
            low = first if abs(first) < _FAR else 1
            return cls(name, low, low + last - first, first, last)
        return cls(name, 1, scaled, first, last)

    @property
    def cells(self) -> int:
        """The length in cells."""
        return self.high - self.low + 1

    def at(self, value: float) -> float:
        """Return the cell of `value`."""
        if self._is_even:
            return value + float(self.low - self.first)
        return self.low + (value - self.first) * (self.high - self.low) / (self.last - self.first)

    def value(self, cell: float) -> float:
        """Return the value at `cell`: the inverse of `at`."""
        if self._is_even:
            return cell - (self.low - self.first)
        return self.first + (cell - self.low) * (self.last - self.first) / (self.high - self.low)

    @property
    def _is_even(self) -> bool:
        """True if each value has its own cell."""
        return self.cells == self.last - self.first + 1

    @property
    def middle(self) -> float:
        """The cell in the middle."""
        return (self.low + self.high) / 2

    @property
    def ground(self) -> float:
        """The height of the ground: one cell below the lowest."""
        return self.low - 1.0

    @property
    def title(self) -> str:
        """The name of the axis, with the unit of its labels if they have one."""
        return self.name if self.unit_m is None else f"{self.name} (m)"

    def text(self, value: Fraction | float) -> str:
        """Return a value as text, in metres to the millimetre if units have a length."""
        return str(value) if self.unit_m is None else f"{round(float(value) * self.unit_m, 3) + 0.0:.10g}"

    @property
    def ticks(self) -> list[tuple[float, str]]:
        """The positions and texts of at most `_TICKS` labels with round numbers."""
        unit = Fraction(1) if self.unit_m is None else Fraction(str(self.unit_m))
        span = (self.last - self.first) * unit
        if unit != 1 and not span:  # a single level may not be at a round number
            return [(self.at(self.first), self.text(self.first))]
        tens = (Fraction(10) ** power for power in count(0 if self.unit_m is None else _LEAST_POWER))
        step = next(digit * ten for ten in tens for digit in (1, 2, 5) if span < _TICKS * digit * ten)
        steps = range(math.ceil(self.first * unit / step), math.floor(self.last * unit / step) + 1)
        values = [number * step / unit for number in steps]
        return [(self.at(float(value)), self.text(value)) for value in values]


@dataclass(frozen=True)
class MissionLayout:
    """The box, and the home of each craft: its initial place on the ground."""

    axes: tuple[BoxAxis, BoxAxis, BoxAxis]
    homes: tuple[Point, ...]

    @property
    def ground(self) -> float:
        """The height of the ground: one cell below the lowest level."""
        return self.axes[2].ground

    def in_metres(self, unit_m: float) -> MissionLayout:
        """Return the same layout with axes in metres. `unit_m` is the length of a unit on the axes `x`, `y` and `z`."""
        rows, columns, levels = (replace(axis, unit_m=unit_m if axis.name in _PLACE else None) for axis in self.axes)
        return replace(self, axes=(rows, columns, levels))

    def places(self, crafts: Sequence[Craft], *, exact: bool = False) -> list[Point | None]:
        """Return the goals of the crafts in the order of `homes`; None for a craft without a level.

        Places too close to each other are moved apart, unless they are `exact`, or depend on real variables.
        """
        taken = _OccupiedPoints()
        around: dict[Point, Iterator[Point]] = {}
        found: list[Point | None] = []
        rows, columns, levels = self.axes
        for craft, (x, y, _) in zip(crafts, self.homes, strict=True):
            place = None
            if craft.level is not None:
                here = (rows.at(craft.cell[0]), columns.at(craft.cell[1])) if craft.cell else (x, y)
                middle = (*here, levels.at(craft.level))
                spots = around.setdefault(middle, _spiral(middle))
                is_fixed = exact or craft.is_exact
                place = middle if is_fixed else next(spot for spot in spots if not taken.is_near(spot))
                taken.add(place)
            found.append(place)
        return found

    def edge(self, number: int) -> Iterator[Point]:
        """Yield landing points for `number` withdrawn drones, in lines before the box."""
        rows, columns, _ = self.axes
        across = max(1, min(number, max(rows.cells, columns.cells) * 3 // 2))
        for x, y in _lines(rows.middle - (across - 1) / 2, across, columns.low - _GAP, -1):
            yield x, y, self.ground


def layout_of(crafts: Sequence[Craft], others: Iterable[Craft] = (), ground: GroundMap | None = None) -> MissionLayout:
    """Return the layout for `crafts`. The axes also include the places of `others`: crafts at other times.

    With a map of the `ground`, the axes include the whole map, and the home of a robot with one craft is the robot's
    place on the map. On a three-dimensional map, homes are in the air.
    """
    others = [*others]
    cells = _cells(crafts)
    included = [*cells, *(other.cell for other in others if other.cell)]
    if ground is not None:
        cells = _standing(crafts, cells, ground)
        included += [*cells, ground.first, ground.x_and_y(ground.columns, ground.rows)]
    volume = ground.volume if ground else None
    heights = [volume.z(1), volume.z(volume.levels)] if volume else []
    axes = _axes(crafts, others, included, max(ground.columns, ground.rows) if ground else 0, heights)
    rows, columns, levels = axes
    beside = _lines(rows.low, rows.cells, columns.high + _GAP, 1)
    homes: list[Point] = []
    taken = _OccupiedPoints()
    exact = _exact_places(crafts, ground) if ground else {}
    for number, (craft, cell) in enumerate(zip(crafts, cells, strict=True)):
        x, y = exact.get(number, cell)
        z = _height(craft, ground, levels, is_exact=number in exact)
        home = (rows.at(x), columns.at(y), z)
        beside_others = taken.is_near(home) and number not in exact
        homes.append((*next(beside), levels.ground) if beside_others else home)
        taken.add(homes[-1])
    return MissionLayout(axes, tuple(homes))


def _cells(crafts: Sequence[Craft]) -> list[Cell]:
    """Return the crafts' cells. Crafts without a cell are placed on a square grid, behind the others."""
    known = [craft.cell for craft in crafts if craft.cell]
    side = math.ceil(math.sqrt(len(crafts) - len(known)))
    x = min((x for x, _ in known), default=1)
    y = max((y + _GAP for _, y in known), default=1)
    grid = ((x + row, y + column) for row in range(side) for column in range(side))
    return [craft.cell or next(grid) for craft in crafts]


def _standing(crafts: Sequence[Craft], cells: Sequence[Cell], ground: GroundMap) -> list[Cell]:
    """Return the crafts' cells on the map; the given cell if a robot has several crafts, or is not on the map."""
    count = Counter(craft.robot for craft in crafts)
    return [
        ground.x_and_y(*ground.starts[craft.robot])
        if count[craft.robot] == 1 and craft.robot in ground.starts
        else cell
        for craft, cell in zip(crafts, cells, strict=True)
    ]


def _exact_places(crafts: Sequence[Craft], ground: GroundMap) -> dict[int, tuple[float, float]]:
    """Return the exact places of crafts, in units of topics, by craft number."""
    count = Counter(craft.robot for craft in crafts)
    found = {}
    for number, craft in enumerate(crafts):
        place = ground.places.get(craft.robot)
        if place and ground.scale and count[craft.robot] == 1:
            found[number] = (place[0] / ground.scale, place[1] / ground.scale)
    return found


def _height(craft: Craft, ground: GroundMap | None, levels: BoxAxis, *, is_exact: bool) -> float:
    """Return the height of a craft, in cells: the height of the ground, or that given by a three-dimensional map."""
    volume = ground.volume if ground else None
    level = volume.starts.get(craft.robot) if volume else None
    if ground is None or volume is None or level is None:
        return levels.ground
    exact = volume.heights.get(craft.robot)
    return levels.at(exact / ground.scale if exact is not None and ground.scale and is_exact else volume.z(level))


def _axes(
    crafts: Sequence[Craft], others: Sequence[Craft], cells: Sequence[Cell], side_of_map: int, heights: Sequence[int]
) -> tuple[BoxAxis, BoxAxis, BoxAxis]:
    most = max(_LEVELS[-1], 3 * math.ceil(math.sqrt(len(crafts))), side_of_map)
    names = _axis_names(crafts)
    rows = BoxAxis.spanning(names[0], (x for x, _ in cells), most=most, scaled=most)
    columns = BoxAxis.spanning(names[1], (y for _, y in cells), most=most, scaled=most)
    side = max(rows.cells, columns.cells)
    values = [craft.level for craft in (*crafts, *others) if craft.level is not None]
    values += heights
    if names[2] == "level" and all(1 <= value <= side for value in values):
        return rows, columns, BoxAxis(names[2], 1, side, 1, side)
    scaled = min(max(side, _LEVELS[0]), _LEVELS[-1])
    tall = max(_TALL, 2 * side, *heights) - min(0, *heights) if heights else max(_TALL, 2 * side)
    return rows, columns, BoxAxis.spanning(names[2], values, most=tall, scaled=scaled)


def _axis_names(crafts: Sequence[Craft]) -> tuple[str, str, str]:
    if all(craft.cell and craft.cell == row_and_column(craft.name) for craft in crafts):
        return "row", "column", "level"
    return ("x", "y", "z") if any(craft.cell for craft in crafts) else ("", "", "value")


def _lines(x: float, across: int, y: int, step: int) -> Iterator[tuple[float, float]]:
    """Yield points beside the box, in lines of `across` points: the first line at `y`, the next `step` further."""
    for number in count():
        yield float(x + number % across), float(y + number // across * step)


class _OccupiedPoints:
    """Finds occupied points near a point. Points are sorted into boxes, so that a search compares few of them."""

    def __init__(self) -> None:
        self._boxes: dict[tuple[int, ...], list[Point]] = {}

    def add(self, point: Point) -> None:
        """Add a point."""
        self._boxes.setdefault(self._box(point), []).append(point)

    def is_near(self, point: Point) -> bool:
        """Return whether one of the points is too close to `point`."""
        boxes = product(*((number - 1, number, number + 1) for number in self._box(point)))
        return any(math.dist(point, other) < _TOO_CLOSE for box in boxes for other in self._boxes.get(box, ()))

    @staticmethod
    def _box(point: Point) -> tuple[int, ...]:
        return tuple(math.floor(part / _TOO_CLOSE) for part in point)


def _spiral(point: Point) -> Iterator[Point]:
    """Yield `point`, then points around it on a spiral, like the seeds of a sunflower."""
    x, y, z = point
    for number in count():
        turn, radius = number * _GOLDEN_ANGLE, _TOO_CLOSE * math.sqrt(number)
        yield (x + radius * math.cos(turn), y + radius * math.sin(turn), z)
