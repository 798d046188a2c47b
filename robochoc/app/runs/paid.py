"""Which rules an answer breaks, and what each rule costs: asked of the values themselves, without a model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import cast

from robochoc.app.sketch.palette import Applied
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule, Value
from robochoc.app.sketch.written import Operand

Decided = Mapping[tuple[str, str], Value]
"""Values by robot and decision, as `values_in` returns them."""


def costly(sketch: Sketch) -> tuple[SketchRule, ...]:
    """Return the rules that may be broken at a cost, and those that cost by degrees."""
    known = (rule for rule in sketch.rules if rule.on and rule.kind in PALETTE)
    return tuple(rule for rule in known if rule.cost is not None or PALETTE[rule.kind].graded)


def values_in(sketch: Sketch, assignment: Mapping[str, Value]) -> dict[tuple[str, str], Value]:
    """Return the values of an answer by robot and decision. What is no value of a decision is left out.

    Args:
        sketch: The sketch that was decided.
        assignment: The values as the user says them, by `ROBOT.DECISION`.
    """
    found: dict[tuple[str, str], Value] = {}
    for decision in sketch.decisions:
        possible = {*sketch.values(decision)}
        for robot in sketch.deciders(decision):
            value = assignment.get(f"{robot}.{decision.name}")
            if value in possible:
                found[robot, decision.name] = value
    return found


def paid(sketch: Sketch, assignment: Mapping[str, Value]) -> dict[str, int]:
    """Return what each rule with costs costs, by its id: 0 where it is kept.

    Rules between robots of which one has stepped aside cost nothing.

    Args:
        sketch: The sketch that was decided.
        assignment: The values as the user says them, by `ROBOT.DECISION`.
    """
    rules = costly(sketch)
    values = values_in(sketch, assignment) if rules else {}
    return {rule.id: price(sketch, rule, values) for rule in rules}


def price(sketch: Sketch, rule: SketchRule, values: Decided) -> int:
    """Return what a rule costs in an answer; of one that must hold, 0."""
    if not PALETTE[rule.kind].graded:
        return (rule.cost or 0) * len(broken_links(sketch, rule, values))
    return sum(cost for _, cost in _said(sketch, rule, values))


def broken_links(sketch: Sketch, rule: SketchRule, values: Decided) -> tuple[tuple[str, ...], ...]:
    """Return the robots of each link for which a rule is broken; none of a graded rule, or where one has no value."""
    if PALETTE[rule.kind].graded:
        return ()
    return tuple(robots for robots, holds in _said(sketch, rule, values) if not holds)


def _said(sketch: Sketch, rule: SketchRule, values: Decided) -> Iterator[tuple[tuple[str, ...], int]]:
    """Yield each link whose robots all have values, and whether it holds there, or what it costs."""
    entry, given = PALETTE[rule.kind], Applied(sketch, rule)
    for robots in entry.groups(sketch, rule):
        if all((robot, rule.decision) in values for robot in robots):
            own = [values[robot, rule.decision] for robot in robots]
            yield robots, int(cast("int", entry.condition(given, cast("list[Operand]", own))))
