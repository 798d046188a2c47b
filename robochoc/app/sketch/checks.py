"""Finds all errors in a sketch, and gives hints on probable mistakes."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from math import prod

from robochoc.app.sketch import element_checks, rule_checks
from robochoc.app.sketch.palette import Applied, Links, PaletteRule
from robochoc.app.sketch.rule_checks import SketchFacts
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule
from robochoc.app.sketch.troubles import About, Severity, Trouble, shortened
from robochoc.solver.compiled_domain import MAX_SOLUTIONS


def troubles(sketch: Sketch) -> list[Trouble]:
    """Return the errors in a sketch, followed by hints. Without errors, `building.model_of` can build its model.

    Hints point out probable mistakes: rules that can never be satisfied, or too many combinations.
    """
    found, facts = _checked(sketch)
    if facts and not any(trouble.is_error for trouble in found):
        found += [*hopeless(facts), *large(facts)]
    return sorted(found, key=lambda trouble: not trouble.is_error)


def errors_of(sketch: Sketch) -> list[Trouble]:
    """Return the errors in a sketch. This is faster than `troubles`, since hints are slow."""
    return [trouble for trouble in _checked(sketch)[0] if trouble.is_error]


def _checked(sketch: Sketch) -> tuple[list[Trouble], SketchFacts | None]:
    """Return all errors and quick hints, and the facts about the sketch if it is within bounds."""
    found = [*element_checks.check_bounds(sketch)]
    if found:
        return found, None
    found += [
        *element_checks.check_names(sketch),
        *element_checks.check_robots(sketch),
        *element_checks.check_decisions(sketch),
    ]
    facts = SketchFacts(sketch)
    return [
        *found,
        *facts.unfit.values(),
        *rule_checks.check_private(facts),
        *rule_checks.check_link_count(facts),
    ], facts


MAX_PAIRS = 10_000
"""The maximum number of pairs of values checked for two robots."""
MAX_TRIED = 100_000
"""The maximum number of pairs of values checked for a sketch."""
MAX_CHECKED_LINKS = 5_000
"""The maximum number of checked links between two robots."""

Values = frozenset[int | str]
Own = dict[tuple[str, str], Values]
"""The values that rules for a single robot allow, by robot and decision."""
_Link = tuple[str, str, str]
"""A decision and two robots."""


def hopeless(facts: SketchFacts) -> Iterator[Trouble]:
    """Yield rules that cannot be satisfied."""
    hard = [rule for rule in facts.sound if rule.cost is None and not PALETTE[rule.kind].graded]
    own: Own = {}
    found = [*_single_conflicts(facts, [rule for rule in hard if PALETTE[rule.kind].links == Links.EACH], own)]
    yield from found
    if found:
        return
    found = [*_pair_conflicts(facts, hard, own)]
    yield from found
    lost = {trouble.element for trouble in found}
    for rule in hard:
        if rule.id not in lost:
            yield from _group_conflicts(facts, rule, own)


def _single_conflicts(facts: SketchFacts, rules: list[SketchRule], own: Own) -> Iterator[Trouble]:
    """Remove from `own` the values that each rule forbids. Yield the rules that leave a robot without values."""
    for rule in rules:
        given, entry = Applied(facts.sketch, rule), PALETTE[rule.kind]
        for (robot,) in entry.groups(facts.sketch, rule):
            left = _left(facts, own, robot, rule.decision)
            own[robot, rule.decision] = allowed = _allowed(entry, given, left)
            if left and not allowed:
                yield _hint(rule, "alone", robot=shortened(robot), decision=shortened(rule.decision))
                break


def _allowed(entry: PaletteRule, given: Applied, left: Values) -> Values:
    return frozenset(value for value in left if entry.holds(given, (value,)))


def _left(facts: SketchFacts, own: Own, robot: str, decision: str) -> Values:
    found = own.get((robot, decision))
    return frozenset(facts.values[decision]) if found is None else found


def _pair_conflicts(facts: SketchFacts, rules: list[SketchRule], own: Own) -> Iterator[Trouble]:
    """Yield the last rule of each group of rules that two robots cannot satisfy together."""
    links: dict[_Link, list[tuple[int, bool]]] = {}
    for place, rule in enumerate(rules):
        entry = PALETTE[rule.kind]
        if entry.links not in {Links.EACH, Links.GROUP}:
            for one, other in entry.groups(facts.sketch, rule):
                links.setdefault((rule.decision, *sorted((one, other))), []).append((place, one > other))  # type: ignore[arg-type] # two
                if len(links) > MAX_CHECKED_LINKS:
                    return
    tried: dict[object, bool] = {}
    reported: set[str] = set()
    budget = MAX_TRIED
    for (decision, one, other), applied in links.items():
        left = _left(facts, own, one, decision), _left(facts, own, other, decision)
        key = (*left, *applied)
        if key not in tried:
            size = prod(map(len, left))
            if size > min(MAX_PAIRS, budget):
                continue
            budget -= size
            tried[key] = _is_satisfiable(facts, left, [(rules[place], turned) for place, turned in applied])
        last = rules[applied[-1][0]]
        if not tried[key] and last.id not in reported:
            reported.add(last.id)
            others = ", ".join(rules[place].id for place, _ in applied)
            yield _hint(last, "two", one=shortened(one), other=shortened(other), rules=others)


def _is_satisfiable(facts: SketchFacts, left: tuple[Values, Values], applied: list[tuple[SketchRule, bool]]) -> bool:
    asked = [(PALETTE[rule.kind], Applied(facts.sketch, rule), turned) for rule, turned in applied]
    return any(
        all(entry.holds(given, pair[::-1] if turned else pair) for entry, given, turned in asked)
        for pair in product(*left)
    )


def _group_conflicts(facts: SketchFacts, rule: SketchRule, own: Own) -> Iterator[Trouble]:
    """Yield `rule` if its robots cannot satisfy it together."""
    robots = facts.sketch.bound(rule)
    left = [_left(facts, own, robot, rule.decision) for robot in robots]
    if rule.kind == "different":
        values = len(frozenset().union(*{*left}))
        if values < len(robots):
            yield _hint(rule, "crowded", count=len(robots), values=values, decision=shortened(rule.decision))
    if rule.kind == "at-least":
        wanted = Applied(facts.sketch, rule)
        able = sum(wanted.value("value") in values for values in left)
        if able < wanted.number("count"):
            yield _hint(rule, "at-least", count=able, wanted=wanted.number("count"))


def large(facts: SketchFacts) -> Iterator[Trouble]:
    """Yield one robot from each group of robots with equal decisions and too many combinations."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for robot in facts.sketch.robots:
        decisions = tuple(name for name, robots in facts.deciders.items() if robot.name in robots)
        if prod(len(facts.values[name]) for name in decisions) > MAX_SOLUTIONS:
            groups.setdefault(decisions, []).append(robot.name)
    for decisions, robots in groups.items():
        named: dict[str, str | int] = {
            "robot": shortened(robots[0]),
            "robots": len(robots),
            "decisions": ", ".join(map(shortened, decisions)),
            "count": prod(len(facts.values[name]) for name in decisions),
            "most": MAX_SOLUTIONS,
        }
        yield Trouble(About.ROBOT, robots[0], "trouble.robot-large", named, Severity.HINT)


def _hint(rule: SketchRule, key: str, **named: str | int) -> Trouble:
    return Trouble(About.RULE, rule.id, f"trouble.never-{key}", named | {"rule": shortened(rule.id)}, Severity.HINT)
