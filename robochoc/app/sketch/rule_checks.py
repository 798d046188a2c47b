"""Checks of the rules in a sketch: their decisions, robots and fields."""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.app.sketch import sketch as limits
from robochoc.app.sketch.element_checks import first_repeated, first_unknown
from robochoc.app.sketch.palette import Form, Links, PaletteRule, RuleField
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Setting, Sketch, SketchRule
from robochoc.app.sketch.troubles import About, Trouble, shortened
from robochoc.app.texts import say

MAX_GROUP = 300
"""The maximum number of robots in one constraint."""
MAX_LINKS = 20_000
"""The maximum number of constraints for all rules together."""
_PAIR = 2

Named = dict[str, str | int]


class SketchFacts:
    """Facts about a sketch that are needed to check several rules."""

    def __init__(self, sketch: Sketch) -> None:
        self.sketch = sketch
        self.robots = {robot.name for robot in sketch.robots}
        self.deciders = {decision.name: {*sketch.deciders(decision)} for decision in sketch.decisions}
        self.values = {decision.name: {*sketch.values(decision)} for decision in sketch.decisions}
        self.unfit = {rule.id: found for rule in sketch.rules if rule.on and (found := _first(self, rule))}
        self.sound = [rule for rule in sketch.rules if rule.on and rule.id not in self.unfit]

    def bound(self, rule: SketchRule) -> int:
        """Return the number of robots in a rule. All of them must have the rule's decision."""
        return len(rule.robots or self.deciders[rule.decision])


def _first(facts: SketchFacts, rule: SketchRule) -> Trouble | None:
    """Return the first error in a rule."""
    return next(_check_rule(facts, rule), None)


def _check_rule(facts: SketchFacts, rule: SketchRule) -> Iterator[Trouble]:
    entry, decision = PALETTE.get(rule.kind), facts.sketch.decision(rule.decision)
    if entry is None:
        yield _trouble(rule, "kind", kind=shortened(rule.kind))
    elif decision is None:
        yield _trouble(rule, "decision", decision=shortened(rule.decision))
    elif decision.kind not in entry.kinds:
        yield _trouble(rule, "fit", decision=shortened(decision.name), kind=say(f"kind.{decision.kind}").lower())
    else:
        yield from _check_robots(facts, rule, entry)
        for opening in entry.openings:
            key = _field_error(rule.settings.get(opening.name), opening, facts.values[decision.name])
            if key:
                named: Named = {"what": say(f"opening.{opening.name}").lower(), "decision": shortened(decision.name)}
                yield _trouble(rule, key, least=opening.least, most=opening.most, **named)
        if rule.cost is not None and not 1 <= rule.cost <= limits.MAX_COST:
            yield _trouble(rule, "cost", most=limits.MAX_COST)


def _trouble(rule: SketchRule, key: str, **named: str | int) -> Trouble:
    return Trouble(About.RULE, rule.id, f"trouble.rule-{key}", named | {"rule": shortened(rule.id)})


def _check_robots(facts: SketchFacts, rule: SketchRule, entry: PaletteRule) -> Iterator[Trouble]:
    """Yield the errors in a rule's robots."""
    stranger, twice = first_unknown(rule.robots, facts.robots), first_repeated(rule.robots)
    idle = first_unknown(rule.robots, facts.deciders[rule.decision])
    count = facts.bound(rule)
    group = entry.links == Links.GROUP
    if stranger is not None:
        yield _trouble(rule, "robot-unknown", robot=shortened(stranger))
    elif twice is not None:
        yield _trouble(rule, "robot-twice", robot=shortened(twice))
    elif idle is not None:
        yield _trouble(rule, "robot-idle", robot=shortened(idle), decision=shortened(rule.decision))
    elif count < entry.fewest:
        yield _trouble(rule, "few", count=count, fewest=entry.fewest)
    elif entry.most is not None and count > entry.most:
        yield _trouble(rule, "many", count=count, most=entry.most)
    elif group and count > MAX_GROUP:
        yield _trouble(rule, "many", count=count, most=MAX_GROUP)
    elif group and rule.private and count > _PAIR:
        yield _trouble(rule, "private-many", count=count)


def _field_error(given: Setting | None, opening: RuleField, values: set[int | str]) -> str | None:
    """Return the key of the error in a field, or None if its value is valid."""
    match opening.form:
        case Form.NUMBER:
            fits = isinstance(given, int) and opening.least <= given <= opening.most
            return None if fits else "number"
        case Form.VALUE:
            return None if _is_value(given, values) else "value"
        case Form.VALUES:
            if not isinstance(given, list) or not given:
                return "values-none"
            return None if all(_is_value(one, values) for one in given) else "values"
        case Form.TABLE:
            return _table_error(given, values)


def _table_error(given: Setting | None, values: set[int | str]) -> str | None:
    if not isinstance(given, list) or not given:
        return "table-none"
    for row in given:
        if not isinstance(row, list) or len(row) != _PAIR or not all(_is_value(one, values) for one in row):
            return "table-row"
    return None


def _is_value(given: object, values: set[int | str]) -> bool:
    return isinstance(given, (int, str)) and given in values


def check_private(facts: SketchFacts) -> Iterator[Trouble]:
    """Yield private rules between two robots in a team with costs, since no protocol for costs supports private rules.

    Rules for a single robot are never disclosed anyway.
    """
    if any(rule.cost is not None or PALETTE[rule.kind].graded for rule in facts.sound):
        for rule in facts.sound:
            if rule.private and PALETTE[rule.kind].links != Links.EACH:
                yield _trouble(rule, "private-cost")


def why_not_private(sketch: Sketch, rule: SketchRule) -> Trouble | None:
    """Return the reason why a rule cannot be private in the current team, or None if it can."""
    entry = PALETTE.get(rule.kind)
    if entry is None or entry.links == Links.EACH:
        return None
    count = len(sketch.bound(rule))
    if entry.links == Links.GROUP and count > _PAIR:
        return _trouble(rule, "private-many", count=count)
    costly = next((one for one in sketch.rules if one.on and (one.cost is not None or _is_graded(one))), None)
    return None if costly is None else _trouble(rule, "private-off", other=shortened(costly.id))


def why_no_cost(sketch: Sketch, rule: SketchRule | None = None) -> Trouble | None:
    """Return the reason why a rule (None: a new one) cannot have a cost in the current team, or None if it can."""
    for other in sketch.rules:
        entry = PALETTE.get(other.kind)
        if other.on and other.private and entry is not None and entry.links != Links.EACH:
            return _trouble(rule or other, "cost-off", other=shortened(other.id))
    return None


def _is_graded(rule: SketchRule) -> bool:
    entry = PALETTE.get(rule.kind)
    return entry is not None and entry.graded


def check_link_count(facts: SketchFacts) -> Iterator[Trouble]:
    """Yield the first rule at which the number of constraints exceeds the limit."""
    total = 0
    for rule in facts.sound:
        total += _links(facts, rule)
        if total > MAX_LINKS:
            yield _trouble(rule, "links", count=total, most=MAX_LINKS)
            return


def _links(facts: SketchFacts, rule: SketchRule) -> int:
    """Return the number of constraints for a rule, or an upper bound if that is far below the limit."""
    entry, count = PALETTE[rule.kind], facts.bound(rule)
    most = count * (count - 1) // 2
    match entry.links:
        case Links.PAIRS:
            return most
        case Links.NEIGHBOURS:
            return most if most <= MAX_LINKS // 10 else sum(1 for _ in entry.groups(facts.sketch, rule))
        case Links.GROUP:
            return 1
        case _:
            return count
