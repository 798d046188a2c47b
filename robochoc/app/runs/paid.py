"""Which rules with costs an answer breaks, and what each costs."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from robochoc.app.runs.labels import value_of
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule, Value
from robochoc.modelling.model import Model


def costly(sketch: Sketch) -> tuple[SketchRule, ...]:
    """Return the rules that may be broken at a cost, and those that cost by degrees."""
    return tuple(rule for rule in sketch.rules if rule.on and (rule.cost is not None or PALETTE[rule.kind].graded))


def paid(sketch: Sketch, assignment: Mapping[str, Value]) -> dict[str, float]:
    """Return what each rule with costs costs, by its id: 0 where it is kept.

    Rules between robots of which one has stepped aside cost nothing.

    Args:
        sketch: The sketch that was decided.
        assignment: The values, by `ROBOT.DECISION`.
    """
    rules = costly(sketch)
    codes = _codes(model_of(msgspec.structs.replace(sketch, rules=())), assignment) if rules else {}
    return {rule.id: _paid_for(sketch, rule, codes) for rule in rules}


def _paid_for(sketch: Sketch, rule: SketchRule, codes: Mapping[str, int]) -> float:
    team = model_of(msgspec.structs.replace(sketch, rules=(rule,))).team
    parts = [one for one in team.constraints() if all(name in codes for name in one.variables)]
    return sum(one.price(codes) for one in parts)


def _codes(model: Model, assignment: Mapping[str, Value]) -> dict[str, int]:
    codes: dict[str, int] = {}
    for name, variable in model.team.variables.items():
        for value in variable.domain:
            if value_of(model, name, value) == assignment.get(name):
                codes[name] = value
    return codes
