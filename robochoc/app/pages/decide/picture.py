"""A team during a run as an SVG: the robots' values or target cells, and the messages in the last second."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from math import hypot

import msgspec

from robochoc.app.sketch.sentences import value_in_short
from robochoc.app.sketch.sketch import Cell, DecisionKind, Sketch, Value
from robochoc.app.texts import say
from robochoc.model.cost_units import Cost, cost_shown

UNIT = 56
"""The size of a cell in the picture."""
Point = tuple[float, float]
_HOME = 9
"""The radius of the ring in a robot's current cell."""
_PILL_HALF = 13
"""Half the height of a robot's label in the target cell."""
_TIP = 9
_LONGEST = 9
"""The number of letters in a name that fit into a cell."""
_BESIDE = (7, 11)
"""The horizontal and vertical distances between robots in the same cell."""


class TargetCell(msgspec.Struct, frozen=True):
    """A robot's target cell, and its other decisions in short form (empty if there are none)."""

    cell: Cell
    beside: str = ""


def decides_places(sketch: Sketch) -> bool:
    """Return whether any robot decides a place, so that the picture is a map."""
    return any(decision.kind == DecisionKind.PLACE for decision in sketch.decisions)


def targets_of(sketch: Sketch, assignment: Mapping[str, Value]) -> dict[str, TargetCell]:
    """Return the target of each robot by name. If a robot decides several places, the first one is its target."""
    cells: dict[str, Cell] = {}
    beside: dict[str, list[str]] = {}
    for decision in sketch.decisions:
        for robot in sketch.deciders(decision):
            value = assignment.get(f"{robot}.{decision.name}")
            if decision.kind == DecisionKind.PLACE:
                if isinstance(value, int) and sketch.area.has(sketch.area.cell(value)):
                    cells.setdefault(robot, sketch.area.cell(value))
            elif value is not None:
                beside.setdefault(robot, []).append(str(value))
    return {robot: TargetCell(cell, " · ".join(beside.get(robot, []))) for robot, cell in cells.items()}


def homes(sketch: Sketch) -> dict[str, Point]:
    """Return each robot's position in the picture. Robots in the same cell are drawn side by side."""
    return _spread({robot.name: robot.at for robot in sketch.robots})


def shown_part(sketch: Sketch) -> tuple[Cell, Cell]:
    """Return the south-western and north-eastern cells of the part to draw: all relevant cells with a margin."""
    cells = [robot.at for robot in sketch.robots]
    for decision in sketch.decisions:
        if decision.kind == DecisionKind.PLACE:
            cells += [sketch.area.cell(value) for value in sketch.values(decision) if isinstance(value, int)]
    across, along = [cell.x for cell in cells] or [0], [cell.y for cell in cells] or [0]
    area = sketch.area
    first = Cell(max(min(across) - 1, 0), max(min(along) - 1, 0))
    return first, Cell(min(max(across) + 1, area.columns - 1), min(max(along) + 1, area.rows - 1))


def map_svg(sketch: Sketch) -> Iterator[str]:
    """Yield the cells of the map, the blocked cells, and the column and row numbers."""
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
    """Return the `viewBox` for the picture's SVG."""
    first, last = shown_part(sketch)
    width, height = (last.x - first.x + 1) * UNIT, (last.y - first.y + 1) * UNIT
    return f"{first.x * UNIT - 26} {-(last.y + 1) * UNIT - 6} {width + 32} {height + 30}"


def robots_with_targets_svg(
    sketch: Sketch,
    targets: Mapping[str, TargetCell],
    says: Mapping[str, str],
    unsettled: frozenset[str],
    aside: frozenset[str],
    *,
    named: bool,
) -> Iterator[str]:
    """Yield the robots: a ring at the robot's position, and an arrow to its target with the robot's name.

    The name of a robot without a target is at its position. `named`: whether there is room for names.
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
    """Return a text shortened to a maximum number of letters."""
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
    width = max(2 * _PILL_HALF, 6.6 * len(text) + 14)
    x, y = at
    return (
        f'<rect x="{x - width / 2:.0f}" y="{y - _PILL_HALF:.0f}" width="{width:.0f}" height="{2 * _PILL_HALF}" '
        f'rx="{_PILL_HALF}"/>'
        f'<text class="value" x="{x:.0f}" y="{y + 4:.0f}" font-size="11">{escape(text)}</text>'
    )


def _arrow(home: Point, there: Point) -> str:
    """Return an arrow from the ring to the label at the target."""
    across, along = there[0] - home[0], there[1] - home[1]
    far = hypot(across, along)
    if far < 2 * (_HOME + _PILL_HALF):
        return ""
    x, y = across / far, along / far
    begin = home[0] + x * _HOME, home[1] + y * _HOME
    tip = there[0] - x * (_PILL_HALF + 6), there[1] - y * (_PILL_HALF + 3)
    back = tip[0] - x * _TIP, tip[1] - y * _TIP
    side = _TIP * 0.5
    return (
        f'<path class="way" d="M{begin[0]:.0f} {begin[1]:.0f}L{back[0]:.0f} {back[1]:.0f}"/>'
        f'<path class="tip" d="M{tip[0]:.1f} {tip[1]:.1f}L{back[0] - y * side:.1f} {back[1] + x * side:.1f}'
        f'L{back[0] + y * side:.1f} {back[1] - x * side:.1f}z"/>'
    )


MOST_MESSAGES = 200
"""The maximum number of lines drawn for messages, for readability."""
MOST_NAMED = 60
"""The maximum number of robots drawn with names. In larger teams only the values are shown."""
_BRIEF = 12
_FEW_LETTERS = 3
_HALF = 19
"""Half the height of a robot's label."""
Says = Mapping[str, str]


def values_of(sketch: Sketch, assignment: Mapping[str, Value]) -> dict[str, str]:
    """Return each robot's decisions in short form, by robot name; places as column and row."""
    said: dict[str, list[str]] = {}
    for decision in sketch.decisions:
        for robot in sketch.deciders(decision):
            value = assignment.get(f"{robot}.{decision.name}")
            if value is not None:
                said.setdefault(robot, []).append(value_in_short(sketch, decision, value))
    return {robot: " · ".join(values) for robot, values in said.items()}


def team_svg(
    sketch: Sketch,
    says: Says,
    *,
    unsettled: frozenset[str] = frozenset(),
    aside: frozenset[str] = frozenset(),
    spoken: Mapping[tuple[str, str], int] = {},
    targets: Mapping[str, TargetCell] = {},
) -> str:
    """Return the picture, which is a map if places are decided. Names given by users are escaped.

    Args:
        sketch: The team.
        says: The text at each robot.
        unsettled: The robots whose values may still change; they are drawn in grey.
        aside: The withdrawn robots.
        spoken: The number of messages in the last second, by sender and receiver.
        targets: The cells chosen by robots.
    """
    if decides_places(sketch):
        named = len(sketch.robots) <= MOST_NAMED
        goers = robots_with_targets_svg(sketch, targets, says, unsettled, aside, named=named)
        return _svg(view_box(sketch), [*map_svg(sketch), *_messages(homes(sketch), spoken), *goers], len(sketch.robots))
    where = _places(sketch)
    left = min((x for x, _ in where.values()), default=0) - UNIT
    right = max((x for x, _ in where.values()), default=0) + UNIT
    top = min((y for _, y in where.values()), default=0) - UNIT * 0.7
    bottom = max((y for _, y in where.values()), default=0) + UNIT * 0.9
    parts = [*_messages(where, spoken), *_robots(where, says, unsettled, aside)]
    return _svg(f"{left:.0f} {top:.0f} {right - left:.0f} {bottom - top:.0f}", parts, len(where))


def _svg(view: str, parts: list[str], robots: int) -> str:
    label = escape(say("decide.picture", count=robots))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" role="img" aria-label="{label}">'
        f"{''.join(parts)}</svg>"
    )


def _places(sketch: Sketch) -> dict[str, tuple[float, float]]:
    """Return each robot's position in the picture, without empty columns and rows.

    Robots in the same cell are drawn side by side.
    """
    columns = {x: place for place, x in enumerate(sorted({robot.at.x for robot in sketch.robots}))}
    rows = {y: place for place, y in enumerate(sorted({robot.at.y for robot in sketch.robots}))}
    taken: dict[Cell, int] = {}
    where: dict[str, tuple[float, float]] = {}
    for robot in sketch.robots:
        beside = taken[robot.at] = taken.get(robot.at, -1) + 1
        x, y = columns[robot.at.x] * UNIT * 1.5, -rows[robot.at.y] * UNIT * 1.3
        where[robot.name] = x + beside * UNIT * 0.4, y + beside * 8
    return where


def _messages(where: Mapping[str, tuple[float, float]], spoken: Mapping[tuple[str, str], int]) -> Iterator[str]:
    most = sorted(spoken.items(), key=lambda one: -one[1])[:MOST_MESSAGES]
    for (sender, receiver), count in most:
        if sender in where and receiver in where:
            (x, y), (to_x, to_y) = where[sender], where[receiver]
            bend_x, bend_y = (x + to_x) / 2 - (to_y - y) * 0.12, (y + to_y) / 2 + (to_x - x) * 0.12
            width = min(4.0, 1 + count**0.5 / 4)
            yield f'<path class="said" d="M{x:.0f} {y:.0f}Q{bend_x:.0f} {bend_y:.0f} {to_x:.0f} {to_y:.0f}" '
            yield f'stroke-width="{width:.1f}"/>'


def _robots(
    where: Mapping[str, tuple[float, float]], says: Says, unsettled: frozenset[str], aside: frozenset[str]
) -> Iterator[str]:
    named = len(where) <= MOST_NAMED
    for robot, (x, y) in where.items():
        kind = "aside" if robot in aside else "unsettled" if robot in unsettled or robot not in says else "settled"
        says_now = brief(says.get(robot, "?" if robot not in aside else "-"), _BRIEF)
        few = len(says_now) <= _FEW_LETTERS
        width = 2 * _HALF if few else max(2 * _HALF, 6.4 * len(says_now) + 16)
        size = 15 if few else 11
        yield f'<g class="{kind}"><rect x="{x - width / 2:.0f}" y="{y - _HALF:.0f}" width="{width:.0f}" '
        yield f'height="{2 * _HALF}" rx="{_HALF}"/>'
        yield f'<text class="value" x="{x:.0f}" y="{y + size * 0.36:.1f}" font-size="{size}">{escape(says_now)}</text>'
        if named:
            yield f'<text class="who" x="{x:.0f}" y="{y + 33:.0f}">{escape(brief(robot, _BRIEF))}</text>'
        yield f"<title>{escape(robot)}: {escape(says.get(robot, '?'))}</title></g>"


def falling_svg(costs: Sequence[tuple[float, Cost]], bound: Cost | None = None, until: float = 0.0) -> str:
    """Return a small chart of the decreasing cost with a caption, and a band down to the lower bound.

    Args:
        costs: The costs of the best answers so far: pairs of seconds since the start and cost.
        bound: The lower bound on the cost. None: unknown.
        until: The end of the chart, in seconds since the start.

    Returns:
        The picture; empty if the cost has not changed and no bound is known.
    """
    known = bound is not None and bool(costs) and bound <= costs[-1][1]
    if len(costs) < 2 and not known:  # noqa: PLR2004 - a line
        return ""
    first, last = costs[0][0], max(costs[-1][0], until)
    best = costs[-1][1]
    low, high = bound if known and bound is not None else best, max(cost for _, cost in costs)
    width, height = 240, 48
    across, along = max(last - first, 1e-9), max(float(high - low), 1e-9)
    path = ""
    for time_s, cost in costs:
        x, y = (time_s - first) / across * width, height - float(cost - low) / along * height
        path += f"H{x:.1f}V{y:.1f}" if path else f"M{x:.1f} {y:.1f}"
    path += f"H{width}" if until else ""
    words = []
    if len(costs) > 1:
        fell = f"{costs[-1][0] - first:.1f}"
        words.append(say("decide.falling", first=cost_shown(costs[0][1]), last=cost_shown(best), seconds=fell))
    if known and low < best:
        words.append(say("decide.band", bound=cost_shown(low), best=cost_shown(best)))
    if not words:  # the first answer was proven optimal
        return ""
    said = escape(" ".join(words))
    band = f'<path class="band" d="{path}H{width}V{height}H0Z"/>' if known else ""
    return (
        f'<figure><svg xmlns="http://www.w3.org/2000/svg" viewBox="-3 -3 {width + 6} {height + 6}" role="img" '
        f'aria-label="{said}">{band}<path class="falling" d="{path}"/></svg><figcaption>{said}</figcaption></figure>'
    )
