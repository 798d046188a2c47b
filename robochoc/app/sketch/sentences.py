"""The rules, values and costs in a sketch, in plain words."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.app.sketch.palette import Form, Links, RuleField
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Decision, DecisionKind, Setting, Sketch, SketchRule
from robochoc.app.texts import say

MOST_NAMED = 4
"""The maximum number of robots or values listed in a sentence; further ones are counted."""
_OPEN = "…"
"""The text for a missing setting of a rule."""


def sentence(sketch: Sketch, rule: SketchRule) -> str:
    """Return a rule as a sentence with its robots, such as "North and South are at least 2 apart in level.".

    Missing and invalid settings are shown as `…`.
    """
    if rule.kind not in PALETTE:
        return say("rule-words.unknown", kind=rule.kind)
    return say(f"rule.{rule.kind}.sentence", **_named(sketch, rule))


def short(sketch: Sketch, rule: SketchRule) -> str:
    """Return the short text of a rule, which is shown at its links in the picture."""
    return say(f"rule.{rule.kind}.short", **_named(sketch, rule)) if rule.kind in PALETTE else rule.kind


def weight_of(rule: SketchRule) -> str:
    """Return the importance of a rule in words: hard, or its cost; private; inactive."""
    entry = PALETTE.get(rule.kind)
    parts = [] if entry and entry.graded else [_must_or_cost(rule)]
    if rule.private:
        parts.append(say("rule-words.alone") if entry and entry.links == Links.EACH else say("rule-words.private"))
    parts += [] if rule.on else [say("rule-words.off")]
    return " ".join(parts)


def _must_or_cost(rule: SketchRule) -> str:
    return say("rule-words.must") if rule.cost is None else say("rule-words.cost", cost=rule.cost)


def value_words(sketch: Sketch, decision: Decision, value: int | str) -> str:
    """Return a value in words. A cell of the map becomes column and row, from 1; other values are unchanged."""
    if decision.kind == DecisionKind.PLACE and isinstance(value, int):
        cell = sketch.area.cell(value)
        return say("value.place", column=cell.x + 1, row=cell.y + 1)
    return str(value)


def value_in_short(sketch: Sketch, decision: Decision, value: int | str) -> str:
    """Return a value for pictures. A cell of the map becomes column and row, from 1; other values are unchanged."""
    if decision.kind == DecisionKind.PLACE and isinstance(value, int):
        cell = sketch.area.cell(value)
        return f"({cell.x + 1}, {cell.y + 1})"
    return str(value)


def listed(names: Sequence[str], most: int = MOST_NAMED) -> str:
    """Return names as a list in a sentence: "A", "A and B", "A, B and C", "A, B, C and 5 others"."""
    if not names:
        return say("list.none")
    if len(names) > most:
        return say("list.more", names=", ".join(names[: most - 1]), count=len(names) - most + 1)
    *before, last = names
    return say("list.and", names=", ".join(before), last=last) if before else last


def _named(sketch: Sketch, rule: SketchRule) -> dict[str, object]:
    entry, decision, bound = PALETTE[rule.kind], sketch.decision(rule.decision), [*sketch.bound(rule)]
    has_leader = entry.links == Links.STAR
    named: dict[str, object] = {
        "decision": rule.decision or _OPEN,
        "robots": _in_order(bound) if entry.has_order and not has_leader else _everybody(sketch, rule, bound),
        "leader": bound[0] if bound else _OPEN,
        "others": listed(bound[1:]) if len(bound) > 1 else _OPEN,
    }
    for opening in entry.openings:
        named[opening.name] = _filled(sketch, decision, opening, rule.settings.get(opening.name))
    return named


def _in_order(bound: list[str]) -> str:
    return listed(bound) if bound else _OPEN


def _everybody(sketch: Sketch, rule: SketchRule, bound: list[str]) -> str:
    if not bound:
        return _OPEN
    few = 2
    return say("list.all") if len(bound) == len(sketch.robots) > few and not rule.robots else listed(bound)


def _filled(sketch: Sketch, decision: Decision | None, opening: RuleField, given: Setting | None) -> str:
    """Return the value of a field, in words."""
    match opening.form, given:
        case Form.NUMBER, int():
            return str(given)
        case Form.VALUE, int() | str() if decision:
            return value_words(sketch, decision, given)
        case Form.VALUES, [_, *_] if decision:
            return listed([value_words(sketch, decision, one) for one in given if isinstance(one, (int, str))])
        case Form.TABLE, [_, *_]:
            return str(len(given))
        case _:
            return _OPEN
