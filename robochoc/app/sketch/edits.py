"""Edits of a sketch. Each edit returns a new sketch, or raises `EditError` with the invalid element.

An edit leaves no dangling references: a removed robot is also removed from rules, and a removed decision with its
rules.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import msgspec

from robochoc.app.sketch import sketch as limits
from robochoc.app.sketch.palette import Form
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Setting, Sketch, SketchRobot, SketchRule
from robochoc.formats.names import MAX_WEIGHT, RESERVED, is_name
from robochoc.system.errors import RobochocError


class EditError(RobochocError, ValueError):
    """An invalid edit: the `key` of the error text in the catalogue, the text's arguments, and the invalid element."""

    def __init__(self, key: str, element: str = "", **named: object) -> None:
        super().__init__(key)
        self.key, self.element, self.named = key, element, named


def renamed(sketch: Sketch, name: str) -> Sketch:
    """Rename the team."""
    return msgspec.structs.replace(sketch, name=_name(name, "team", ()))


# Robots


def with_robot(sketch: Sketch, at: Cell, name: str | None = None) -> Sketch:
    """Add a robot in a cell. Without `name`, it is given an unused name."""
    if len(sketch.robots) >= limits.MAX_ROBOTS:
        raise EditError("edit.too-many-robots", most=limits.MAX_ROBOTS)
    check_cell(sketch, at)
    taken = {robot.name for robot in sketch.robots}
    chosen = _free_name("Drone", taken) if name is None else _name(name, "robot", taken)
    return msgspec.structs.replace(sketch, robots=(*sketch.robots, SketchRobot(chosen, at)))


def without_robot(sketch: Sketch, name: str) -> Sketch:
    """Remove a robot, also from decisions and rules. Decisions and rules of this robot alone are removed."""
    robots = tuple(robot for robot in sketch.robots if robot.name != name)
    decisions = tuple(
        msgspec.structs.replace(one, robots=_without(one.robots, name))
        for one in sketch.decisions
        if one.robots != (name,)
    )
    rules = tuple(
        msgspec.structs.replace(rule, robots=_without(rule.robots, name))
        for rule in sketch.rules
        if rule.robots != (name,)
    )
    return _without_lost_rules(msgspec.structs.replace(sketch, robots=robots, decisions=decisions, rules=rules))


def with_robot_moved(sketch: Sketch, name: str, to: Cell) -> Sketch:
    """Move a robot to another cell."""
    check_cell(sketch, to, name)
    return _with_robot(sketch, name, lambda robot: msgspec.structs.replace(robot, at=to))


def with_robot_renamed(sketch: Sketch, name: str, new: str) -> Sketch:
    """Rename a robot, also in decisions and rules."""
    chosen = _name(new, name, {robot.name for robot in sketch.robots} - {name})

    def updated(names: Sequence[str]) -> tuple[str, ...]:
        return tuple(chosen if other == name else other for other in names)

    return msgspec.structs.replace(
        _with_robot(sketch, name, lambda robot: msgspec.structs.replace(robot, name=chosen)),
        decisions=tuple(msgspec.structs.replace(one, robots=updated(one.robots)) for one in sketch.decisions),
        rules=tuple(msgspec.structs.replace(rule, robots=updated(rule.robots)) for rule in sketch.rules),
    )


def with_importance(sketch: Sketch, name: str, *, weight: int | None = None, rank: int | None = None) -> Sketch:
    """Set the weight of a robot's withdrawal, and its rank."""
    if weight is not None and not 1 <= weight <= MAX_WEIGHT:
        raise EditError("edit.weight", name, most=MAX_WEIGHT)
    if rank is not None and abs(rank) > MAX_WEIGHT:
        raise EditError("edit.rank", name, most=MAX_WEIGHT)
    changes = {key: value for key, value in (("weight", weight), ("rank", rank)) if value is not None}
    return _with_robot(sketch, name, lambda robot: msgspec.structs.replace(robot, **changes))


# The map


def with_area(sketch: Sketch, columns: int, rows: int) -> Sketch:
    """Resize the map. Robots outside the new map are moved to its edge; cells keep their positions."""
    most = limits.MAX_SIDE
    if not (1 <= columns <= most and 1 <= rows <= most):
        raise EditError("edit.map", "map", most=most)
    return resized(sketch, columns, rows)


def with_cell_blocked(sketch: Sketch, cell: Cell, *, blocked: bool) -> Sketch:
    """Block or free a cell of the map. Blocked cells cannot be chosen in decisions."""
    check_cell(sketch, cell)
    cells = sketch.area.blocked | {cell} if blocked else sketch.area.blocked - {cell}
    return msgspec.structs.replace(sketch, area=msgspec.structs.replace(sketch.area, blocked=cells))


# Decisions


def with_decision(sketch: Sketch, decision: Decision, *, instead_of: str | None = None) -> Sketch:
    """Add a decision, or replace one. Rules that no longer fit the decision are reported by `checks`."""
    others = {one.name for one in sketch.decisions} - {instead_of}
    if instead_of is None and len(sketch.decisions) >= limits.MAX_DECISIONS:
        raise EditError("edit.too-many-decisions", most=limits.MAX_DECISIONS)
    name = _name(decision.name, instead_of or "decision", others)
    if len(decision.values) > limits.MAX_VALUES:
        raise EditError("edit.too-many-values", name, most=limits.MAX_VALUES)
    made = msgspec.structs.replace(decision, name=name, values=tuple(dict.fromkeys(decision.values)))
    if instead_of is None:
        return msgspec.structs.replace(sketch, decisions=(*sketch.decisions, made))
    rules = tuple(
        msgspec.structs.replace(rule, decision=name) if rule.decision == instead_of else rule for rule in sketch.rules
    )
    decisions = tuple(made if one.name == instead_of else one for one in sketch.decisions)
    return msgspec.structs.replace(sketch, decisions=decisions, rules=rules)


def without_decision(sketch: Sketch, name: str) -> Sketch:
    """Remove a decision together with its rules."""
    decisions = tuple(one for one in sketch.decisions if one.name != name)
    return _without_lost_rules(msgspec.structs.replace(sketch, decisions=decisions))


# Rules


def with_rule(sketch: Sketch, rule: SketchRule) -> Sketch:
    """Add a rule, or replace the rule with the same id. A new rule is given an unused id."""
    if rule.cost is not None and not 1 <= rule.cost <= limits.MAX_COST:
        raise EditError("edit.cost", rule.id, most=limits.MAX_COST)
    if sketch.rule(rule.id) is not None:
        rules = tuple(rule if one.id == rule.id else one for one in sketch.rules)
        return msgspec.structs.replace(sketch, rules=rules)
    if len(sketch.rules) >= limits.MAX_RULES:
        raise EditError("edit.too-many-rules", most=limits.MAX_RULES)
    made = msgspec.structs.replace(rule, id=_free_name("R", {one.id for one in sketch.rules}))
    return msgspec.structs.replace(sketch, rules=(*sketch.rules, made))


def without_rule(sketch: Sketch, name: str) -> Sketch:
    """Remove a rule."""
    return msgspec.structs.replace(sketch, rules=tuple(rule for rule in sketch.rules if rule.id != name))


def with_rule_switched(sketch: Sketch, name: str, *, on: bool) -> Sketch:
    """Activate or deactivate a rule."""
    rules = tuple(msgspec.structs.replace(rule, on=on) if rule.id == name else rule for rule in sketch.rules)
    return msgspec.structs.replace(sketch, rules=rules)


# Common functions


def _with_robot(sketch: Sketch, name: str, change: Callable[[SketchRobot], SketchRobot]) -> Sketch:
    robots = tuple(change(robot) if robot.name == name else robot for robot in sketch.robots)
    return msgspec.structs.replace(sketch, robots=robots)


def _without_lost_rules(sketch: Sketch) -> Sketch:
    known = {decision.name for decision in sketch.decisions}
    return msgspec.structs.replace(sketch, rules=tuple(rule for rule in sketch.rules if rule.decision in known))


def _without(names: Sequence[str], name: str) -> tuple[str, ...]:
    return tuple(one for one in names if one != name)


def check_cell(sketch: Sketch, cell: Cell, element: str = "map") -> None:
    """Raise `EditError` for a cell outside the map."""
    if not sketch.area.has(cell):
        raise EditError("edit.outside", element, columns=sketch.area.columns, rows=sketch.area.rows)


def _name(name: str, element: str, taken: Sequence[str] | set[str]) -> str:
    """Return a valid name from the user's input. Raises `EditError` if it is invalid or in use."""
    chosen = name.strip()
    if not is_name(chosen) or chosen == RESERVED or len(chosen) > limits.MAX_LABEL:
        raise EditError("edit.name", element, name=chosen[: limits.MAX_LABEL])
    if chosen in taken:
        raise EditError("edit.name-taken", element, name=chosen)
    return chosen


def _free_name(stem: str, taken: set[str]) -> str:
    return next(f"{stem}{number}" for number in range(1, len(taken) + 2) if f"{stem}{number}" not in taken)


def resized(sketch: Sketch, columns: int, rows: int) -> Sketch:
    """Return the sketch with a map of this size. Cells keep their positions, so their numbers change.

    Robots outside the new map are moved to its edge. Removed cells are dropped from decisions and rules: `checks` then
    reports the missing setting of a rule, and a decision without remaining cells is given all free cells.
    """
    blocked = frozenset(cell for cell in sketch.area.blocked if cell.x < columns and cell.y < rows)
    area = Area(columns, rows, blocked)
    robots = tuple(
        msgspec.structs.replace(robot, at=Cell(min(robot.at.x, columns - 1), min(robot.at.y, rows - 1)))
        for robot in sketch.robots
    )
    places = {decision.name for decision in sketch.decisions if decision.kind == DecisionKind.PLACE}
    moved = _ResizedMap(sketch.area, area)
    return msgspec.structs.replace(
        sketch,
        area=area,
        robots=robots,
        decisions=tuple(moved.decision(one) if one.name in places else one for one in sketch.decisions),
        rules=tuple(moved.rule(rule) if rule.decision in places else rule for rule in sketch.rules),
    )


class _ResizedMap:
    """Converts cells of a map to the cells of a map of another size."""

    def __init__(self, before: Area, after: Area) -> None:
        self._before, self._after = before, after

    def decision(self, decision: Decision) -> Decision:
        """Return a decision with the new numbers of its remaining cells."""
        return msgspec.structs.replace(decision, values=tuple(self._values(decision.values)))

    def rule(self, rule: SketchRule) -> SketchRule:
        """Return a rule with the new numbers of its remaining cells."""
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
