"""The rules in a sketch that can be in conflict, and the deletion filter, which finds a minimal set of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

import msgspec

from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule


def candidates(sketch: Sketch) -> tuple[SketchRule, ...]:
    """Return the hard rules, which can be in conflict. Domains are not part of a conflict."""
    return tuple(rule for rule in sketch.rules if rule.on and rule.cost is None and not PALETTE[rule.kind].graded)


def with_only(sketch: Sketch, rules: Collection[str]) -> Sketch:
    """Return the sketch with only these rules."""
    kept = tuple(rule for rule in sketch.rules if rule.id in rules)
    return msgspec.structs.replace(sketch, rules=kept)


def minimal(rules: Sequence[str], holds_together: Callable[[Sequence[str]], bool]) -> tuple[str, ...] | None:
    """Return a minimal set of rules that cannot be satisfied together, or None if all rules can.

    Deletion filter: each rule in turn is dropped if the remaining rules still cannot be satisfied together (Chinneck
    and Dravnieks, Locating minimal infeasible constraint sets in linear programs, 1991).

    Args:
        rules: The rules.
        holds_together: Returns whether a subset of the rules can be satisfied together.
    """
    if holds_together(rules):
        return None
    left = [*rules]
    for rule in rules:
        without = [other for other in left if other != rule]
        if not holds_together(without):
            left = without
    return tuple(left)


def rule_of(constraint: str, rules: Iterable[str]) -> str | None:
    """Return the rule that a constraint in `building.model_of` belongs to, given the constraint's name."""
    fitting = [rule for rule in rules if constraint == rule or constraint.startswith(f"{rule}.")]
    return max(fitting, key=len, default=None)
