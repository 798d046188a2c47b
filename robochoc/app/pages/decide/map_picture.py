"""The map of a team that decides places: cells, walls, the robots' positions and their targets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from math import hypot

import msgspec

from robochoc.app.sketch.sketch import Cell, Kind, Sketch, Value

UNIT = 56
"""The size of a cell."""
Point = tuple[float, float]
_HOME = 9
"""The radius of the ring in a robot's own cell."""
_HALF = 13
"""Half the height of a robot's label in its target cell."""
_TIP = 9
_LONGEST = 9
"""The number of letters of a name that fit into a cell."""
_BESIDE = (7, 11)
"""The horizontal and vertical distance between robots in one cell."""


class Target(msgspec.Struct, frozen=True):
    """The target cell of a robot, and its other decisions in short (empty if there are none)."""

    cell: Cell
    beside: str = ""


def decides_places(sketch: Sketch) -> bool:
    """Return whether a robot decides a place, so that the picture of the team is a map."""
    return any(decision.kind == Kind.PLACE for decision in sketch.decisions)


def targets_of(sketch: Sketch, assignment: Mapping[str, Value]) -> dict[str, Target]:
    """Return the targets of robots by their names; if a robot decides several places, the first one."""
    cells: dict[str, Cell] = {}
    beside: dict[str, list[str]] = {}
    for decision in sketch.decisions:
        for robot in sketch.deciders(decision):
            value = assignment.get(f"{robot}.{decision.name}")
            if decision.kind == Kind.PLACE:
                if isinstance(value, int) and sketch.area.has(sketch.area.cell(value)):
                    cells.setdefault(robot, sketch.area.cell(value))
            elif value is not None:
                beside.setdefault(robot, []).append(str(value))
    return {robot: Target(cell, " · ".join(beside.get(robot, []))) for robot, cell in cells.items()}


def homes(sketch: Sketch) -> dict[str, Point]:
    """Return each robot's position in the picture; robots in one cell are drawn beside each other."""
    return _spread({robot.name: robot.at for robot in sketch.robots})


def shown_part(sketch: Sketch) -> tuple[Cell, Cell]:
    """Return the south-western and north-eastern cell of the drawn part: all relevant cells and a margin."""
    cells = [robot.at for robot in sketch.robots]
    for decision in sketch.decisions:
        if decision.kind == Kind.PLACE:
            cells += [sketch.area.cell(value) for value in sketch.values(decision) if isinstance(value, int)]
    across, along = [cell.x for cell in cells] or [0], [cell.y for cell in cells] or [0]
    area = sketch.area
    first = Cell(max(min(across) - 1, 0), max(min(along) - 1, 0))
    return first, Cell(min(max(across) + 1, area.columns - 1), min(max(along) + 1, area.rows - 1))


def map_svg(sketch: Sketch) -> Iterator[str]:
    """Yield the cells of the map, the blocked cells, and the numbers of columns and rows."""
    first, last = shown_part(sketch)
    left, top = first.x * UNIT, -(last.y + 1) * UNIT
    width, height = (last.x - first.x + 1) * UNIT, (last.y - first.y + 1) * UNIT
    lines = "".join(f"M{left + step} {top}v{height}" for step in range(0, width + 1, UNIT))
    lines += "".join(f"M{left} {top + step}h{width}" for step in range(0, height + 1, UNIT))
    walls = "".join(
        f"M{cell.x * UNIT} {-(cell.y + 1) * UNIT}h{UNIT}v{UNIT}h-{UNIT}z"
        for cell in sorted(sketch.area.blocked)
        if first.x <= cell.x <= last.x and first.y <= cell.y <= last.y
    )
    yield f'<path class="cells" d="{lines}"/><path class="wall" d="{walls}"/>'
    every = 1 if max(width, height) <= 20 * UNIT else 5
    for column in range(first.x, last.x + 1):
        if (column + 1) % every == 0 or column == first.x:
            yield f'<text class="axis" x="{(column + 0.5) * UNIT:.0f}" y="{top + height + 16}">{column + 1}</text>'
    for row in range(first.y, last.y + 1):
        if (row + 1) % every == 0 or row == first.y:
            yield f'<text class="axis" x="{left - 14}" y="{-(row + 0.5) * UNIT + 4:.0f}">{row + 1}</text>'


def view_box(sketch: Sketch) -> str:
    """Return the `viewBox` of the picture's SVG."""
    first, last = shown_part(sketch)
    width, height = (last.x - first.x + 1) * UNIT, (last.y - first.y + 1) * UNIT
    return f"{first.x * UNIT - 26} {-(last.y + 1) * UNIT - 6} {width + 32} {height + 30}"


def goers_svg(
    sketch: Sketch,
    targets: Mapping[str, Target],
    says: Mapping[str, str],
    unsettled: frozenset[str],
    aside: frozenset[str],
    *,
    named: bool,
) -> Iterator[str]:
    """Yield the robots: a ring at the robot's position, an arrow to its target, and the name there.

    A robot without a target has its name at its position. `named`: whether there is room for names.
    """
    at_home = homes(sketch)
    chosen = _spread({name: target.cell for name, target in targets.items() if name in at_home})
    for robot, home in at_home.items():
        is_aside = robot in aside
        kind = "aside" if is_aside else "unsettled" if robot in unsettled or robot not in says else "settled"
        there = home if is_aside else chosen.get(robot, home)
        yield f'<g class="{kind}">'
        if there != home:
            yield f'<circle class="home" cx="{home[0]:.0f}" cy="{home[1]:.0f}" r="{_HOME}"/>{_arrow(home, there)}'
        beside = targets[robot].beside if robot in targets else says.get(robot, "")
        text = " · ".join(filter(None, [brief(robot, _LONGEST), "" if is_aside else beside])) if named else ""
        yield _pill(there, text)
        yield f"<title>{escape(robot)}: {escape('-' if is_aside else says.get(robot, '?'))}</title></g>"


def brief(text: str, most: int) -> str:
    """Return a text, shortened to a maximum number of letters."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def _spread(cells: Mapping[str, Cell]) -> dict[str, Point]:
    taken: dict[Cell, int] = {}
    where: dict[str, Point] = {}
    for name, cell in cells.items():
        number = taken[cell] = taken.get(cell, -1) + 1
        turn = number % 3
        where[name] = (
            (cell.x + 0.5) * UNIT + turn * _BESIDE[0],
            -(cell.y + 0.5) * UNIT + turn * _BESIDE[1],
        )
    return where


def _pill(at: Point, text: str) -> str:
    width = max(2 * _HALF, 6.6 * len(text) + 14)
    x, y = at
    return (
        f'<rect x="{x - width / 2:.0f}" y="{y - _HALF:.0f}" width="{width:.0f}" height="{2 * _HALF}" rx="{_HALF}"/>'
        f'<text class="value" x="{x:.0f}" y="{y + 4:.0f}" font-size="11">{escape(text)}</text>'
    )


def _arrow(home: Point, there: Point) -> str:
    """Return an arrow from the ring to the label."""
    across, along = there[0] - home[0], there[1] - home[1]
    far = hypot(across, along)
    if far < 2 * (_HOME + _HALF):
        return ""
    x, y = across / far, along / far
    begin = home[0] + x * _HOME, home[1] + y * _HOME
    tip = there[0] - x * (_HALF + 6), there[1] - y * (_HALF + 3)
    back = tip[0] - x * _TIP, tip[1] - y * _TIP
    side = _TIP * 0.5
    return (
        f'<path class="way" d="M{begin[0]:.0f} {begin[1]:.0f}L{back[0]:.0f} {back[1]:.0f}"/>'
        f'<path class="tip" d="M{tip[0]:.1f} {tip[1]:.1f}L{back[0] - y * side:.1f} {back[1] + x * side:.1f}'
        f'L{back[0] + y * side:.1f} {back[1] - x * side:.1f}z"/>'
    )
