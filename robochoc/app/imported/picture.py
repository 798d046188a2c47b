"""The picture of an imported team: its robots at the positions in their files, or side by side."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, sqrt

from robochoc.app.imported.facts import has_place
from robochoc.app.sketch.open_from_disk import ImportedTeam
from robochoc.app.sketch.sketch import MAX_ROBOTS, MAX_SIDE, Area, Cell, Sketch, SketchRobot
from robochoc.flight.crafts import crafts_of
from robochoc.model.problem import Robot

_FEWEST_COLUMNS, _FEWEST_ROWS = 8, 6


def picture_sketch(team: ImportedTeam) -> Sketch:
    """Return a sketch of a team's robots, without decisions and rules, which are in the files."""
    robots = team.team.robots[:MAX_ROBOTS]
    cells = _cells_in_files(robots) or _side_by_side(len(robots))
    columns = max(_FEWEST_COLUMNS, 1 + max((cell.x for cell in cells), default=0))
    rows = max(_FEWEST_ROWS, 1 + max((cell.y for cell in cells), default=0))
    placed = zip(robots, cells, strict=True)
    return Sketch(team.name, Area(columns, rows), tuple(SketchRobot(robot.name, cell) for robot, cell in placed))


def _cells_in_files(robots: Sequence[Robot]) -> list[Cell] | None:
    """Return the fixed cells given in the robots' files, or None if there are none or they do not fit on a map."""
    if not all(map(has_place, robots)):
        return None
    found = [craft.cell for robot in robots for craft in crafts_of(robot, {})[:1]]
    said = [(round(cell[0]), round(cell[1])) for cell in found if cell is not None]
    if len(set(said)) < len(robots):
        return None
    left, bottom = min((x for x, _ in said), default=0), min((y for _, y in said), default=0)
    cells = [Cell(x - left, y - bottom) for x, y in said]
    return cells if all(cell.x < MAX_SIDE and cell.y < MAX_SIDE for cell in cells) else None


def _side_by_side(count: int) -> list[Cell]:
    columns = min(MAX_SIDE, max(_FEWEST_COLUMNS, ceil(sqrt(count))))
    rows = max(_FEWEST_ROWS, ceil(count / columns))
    return [Cell(number % columns, rows - 1 - number // columns) for number in range(count)]
