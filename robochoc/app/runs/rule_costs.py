"""The violated rules in an answer, and the cost of each rule, computed from the values without a model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import cast

from robochoc.app.sketch.palette import Applied
from robochoc.app.sketch.python_text import Operand
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule, Value

Decided = Mapping[tuple[str, str], Value]
"""Values by robot and decision, as `values_by_robot` returns them."""


def rules_with_costs(sketch: Sketch) -> tuple[SketchRule, ...]:
    """Return the soft rules, and the rules with graded costs."""
    known = (rule for rule in sketch.rules if rule.on and rule.kind in PALETTE)
    return tuple(rule for rule in known if rule.cost is not None or PALETTE[rule.kind].graded)


def values_by_robot(sketch: Sketch, assignment: Mapping[str, Value]) -> dict[tuple[str, str], Value]:
    """Return the values in an answer by robot and decision. Invalid values are left out.

    Args:
        sketch: The sketch that was solved.
        assignment: The user's values, by `ROBOT.DECISION`.
    """
    found: dict[tuple[str, str], Value] = {}
    for decision in sketch.decisions:
        possible = {*sketch.values(decision)}
        for robot in sketch.deciders(decision):
            value = assignment.get(f"{robot}.{decision.name}")
            if value in possible:
                found[robot, decision.name] = value
    return found


def rule_costs(sketch: Sketch, assignment: Mapping[str, Value]) -> dict[str, int]:
    """Return the cost of each rule with costs, by rule id; 0 for a satisfied rule.

    The rules of withdrawn robots cost nothing.

    Args:
        sketch: The sketch that was solved.
        assignment: The user's values, by `ROBOT.DECISION`.
    """
    rules = rules_with_costs(sketch)
    values = values_by_robot(sketch, assignment) if rules else {}
    return {rule.id: rule_cost(sketch, rule, values) for rule in rules}


def rule_cost(sketch: Sketch, rule: SketchRule, values: Decided) -> int:
    """Return the cost of a rule in an answer, which is 0 for a hard rule."""
    if not PALETTE[rule.kind].graded:
        return (rule.cost or 0) * len(violated_links(sketch, rule, values))
    return sum(cost for _, cost in _link_values(sketch, rule, values))


def violated_links(sketch: Sketch, rule: SketchRule, values: Decided) -> tuple[tuple[str, ...], ...]:
    """Return the robots in each link that violates a rule; empty if the rule is graded, or a robot has no value."""
    if PALETTE[rule.kind].graded:
        return ()
    return tuple(robots for robots, holds in _link_values(sketch, rule, values) if not holds)


def _link_values(sketch: Sketch, rule: SketchRule, values: Decided) -> Iterator[tuple[tuple[str, ...], int]]:
    """Yield each link whose robots all have values, with whether it is satisfied, or with its cost."""
    entry, given = PALETTE[rule.kind], Applied(sketch, rule)
    for robots in entry.groups(sketch, rule):
        if all((robot, rule.decision) in values for robot in robots):
            own = [values[robot, rule.decision] for robot in robots]
            yield robots, int(cast("int", entry.condition(given, cast("list[Operand]", own))))
