"""A map of another size: cells keep where they are, so their numbers change, and with them what names cells."""

from __future__ import annotations

import msgspec

from robochoc.app.sketch.palette import Form
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Area, Cell, Decision, Kind, Setting, Sketch, SketchRule


def resized(sketch: Sketch, columns: int, rows: int) -> Sketch:
    """Return the sketch on a map of that size.

    Robots that would be outside move to its edge. Decisions and rules forget the cells that are gone: a rule then
    lacks what `checks` tells, and a decision that has no cell left takes all that are free.
    """
    blocked = frozenset(cell for cell in sketch.area.blocked if cell.x < columns and cell.y < rows)
    area = Area(columns, rows, blocked)
    robots = tuple(
        msgspec.structs.replace(robot, at=Cell(min(robot.at.x, columns - 1), min(robot.at.y, rows - 1)))
        for robot in sketch.robots
    )
    places = {decision.name for decision in sketch.decisions if decision.kind == Kind.PLACE}
    moved = _Moved(sketch.area, area)
    return msgspec.structs.replace(
        sketch,
        area=area,
        robots=robots,
        decisions=tuple(moved.decision(one) if one.name in places else one for one in sketch.decisions),
        rules=tuple(moved.rule(rule) if rule.decision in places else rule for rule in sketch.rules),
    )


class _Moved:
    """The cells of one map on another one."""

    def __init__(self, before: Area, after: Area) -> None:
        self._before, self._after = before, after

    def decision(self, decision: Decision) -> Decision:
        """Return a decision about the same cells."""
        return msgspec.structs.replace(decision, values=tuple(self._values(decision.values)))

    def rule(self, rule: SketchRule) -> SketchRule:
        """Return a rule about the same cells."""
        settings = dict(rule.settings)
        for opening in PALETTE[rule.kind].openings if rule.kind in PALETTE else ():
            if opening.form != Form.NUMBER and opening.name in settings:
                kept = self._setting(settings.pop(opening.name))
                if kept is not None:
                    settings[opening.name] = kept
        return msgspec.structs.replace(rule, settings=settings)

    def _setting(self, given: Setting) -> Setting | None:
        if not isinstance(given, list):
            return next(iter(self._values([given])), None)
        rows = [self._values(row) for row in given if isinstance(row, list)]
        whole = 2
        return [
            *self._values([one for one in given if not isinstance(one, list)]),
            *(r for r in rows if len(r) == whole),
        ]

    def _values(self, values: list[int | str] | tuple[int | str, ...]) -> list[int | str]:
        cells = (self._before.cell(value) if isinstance(value, int) else None for value in values)
        return [self._after.number(cell) for cell in cells if cell is not None and self._after.has(cell)]
