"""What a click on the board means while a rule, or a decision about places, is open."""

from __future__ import annotations

import msgspec

from robochoc.app.pages.model.values import with_cell
from robochoc.app.sketch.edits import EditError, check_cell, with_decision, with_rule
from robochoc.app.sketch.palette import Form
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Cell, Kind, Setting, Sketch, SketchRule


def with_robot_clicked(sketch: Sketch, rule: SketchRule, name: str) -> Sketch:
    """Take a robot into a rule, or out of it. A rule about everybody is then about this robot, and who comes next.

    Raises:
        EditError: if it is the last one that the rule names: without a name, a rule is about everybody.
    """
    if sketch.robot(name) is None:
        return sketch  # somebody has removed it meanwhile
    robots = rule.robots
    if robots == (name,):
        raise EditError("edit.last-of-rule", rule.id, robot=name)
    kept = tuple(one for one in robots if one != name) if name in robots else (*robots, name)
    return with_rule(sketch, msgspec.structs.replace(rule, robots=kept))


def with_cell_clicked(sketch: Sketch, cell: Cell, cells_of: str | None, opened: str | None) -> Sketch:
    """Take a cell into the values of the decision `cells_of`, or into the rule that is open, or out of it.

    Raises:
        EditError: if it is not on the map (any more), or the last cell that can be chosen.
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
