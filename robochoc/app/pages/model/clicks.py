"""Clicks on the board while a rule, or the cells of a decision, are edited."""

from __future__ import annotations

import msgspec

from robochoc.app.pages.model.values import with_cell
from robochoc.app.sketch.edits import EditError, check_cell, with_decision, with_rule
from robochoc.app.sketch.palette import Form
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Cell, Kind, Setting, Sketch, SketchRule


def with_robot_clicked(sketch: Sketch, rule: SketchRule, name: str) -> Sketch:
    """Add a robot to a rule, or remove it. A rule of all robots becomes a rule of this robot.

    Raises:
        EditError: if it is the last robot of the rule: a rule without robots applies to all.
    """
    if sketch.robot(name) is None:
        return sketch  # the robot was removed meanwhile
    robots = rule.robots
    if robots == (name,):
        raise EditError("edit.last-of-rule", rule.id, robot=name)
    kept = tuple(one for one in robots if one != name) if name in robots else (*robots, name)
    return with_rule(sketch, msgspec.structs.replace(rule, robots=kept))


def with_cell_clicked(sketch: Sketch, cell: Cell, cells_of: str | None, opened: str | None) -> Sketch:
    """Add a cell to the values of the decision `cells_of` or to the open rule, or remove it.

    Raises:
        EditError: if the cell is not on the map (any more), or is the last value.
    """
    check_cell(sketch, cell)
    decision = None if cells_of is None else sketch.decision(cells_of)
    if decision is not None and decision.kind == Kind.PLACE:
        values = with_cell(sketch, decision, sketch.area.number(cell))
        made = msgspec.structs.replace(decision, values=values)
        return with_decision(sketch, made, instead_of=decision.name)
    rule = None if opened is None else sketch.rule(opened)
    return sketch if rule is None else _with_cell_in_rule(sketch, rule, sketch.area.number(cell))


def _with_cell_in_rule(sketch: Sketch, rule: SketchRule, number: int) -> Sketch:
    decision = sketch.decision(rule.decision)
    if decision is None or decision.kind != Kind.PLACE or number not in sketch.values(decision):
        return sketch
    for opening in PALETTE[rule.kind].openings:
        if opening.form == Form.VALUE:
            return _filled(sketch, rule, opening.name, number)
        if opening.form == Form.VALUES:
            given = rule.settings.get(opening.name)
            cells = [one for one in given if isinstance(one, int)] if isinstance(given, list) else []
            kept = [one for one in cells if one != number] if number in cells else [*cells, number]
            return _filled(sketch, rule, opening.name, [*kept])
    return sketch


def _filled(sketch: Sketch, rule: SketchRule, name: str, value: Setting) -> Sketch:
    return with_rule(sketch, msgspec.structs.replace(rule, settings={**rule.settings, name: value}))
