"""The rules of a sketch as candidates for a conflict, and the deletion that makes a set of them minimal."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

import msgspec

from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule


def candidates(sketch: Sketch) -> tuple[SketchRule, ...]:
    """Return the rules that must hold, and so can be in each other's way. Domains are as they are given."""
    return tuple(rule for rule in sketch.rules if rule.on and rule.cost is None and not PALETTE[rule.kind].graded)


def with_only(sketch: Sketch, rules: Collection[str]) -> Sketch:
    """Return the sketch with these rules alone."""
    kept = tuple(rule for rule in sketch.rules if rule.id in rules)
    return msgspec.structs.replace(sketch, rules=kept)


def minimal(rules: Sequence[str], holds_together: Callable[[Sequence[str]], bool]) -> tuple[str, ...] | None:
    """Return rules that cannot hold together, but without any one of them they can; None: all can.

    It is found by deletion: each rule is left out in turn, for good if the others still cannot hold together
    (Chinneck and Dravnieks, Locating minimal infeasible constraint sets in linear programs, 1991).

    Args:
        rules: The rules.
        holds_together: Whether some of them have a solution.
    """
    if holds_together(rules):
        return None
    left = [*rules]
    for rule in rules:
        without = [one for one in left if one != rule]
        if not holds_together(without):
            left = without
    return tuple(left)


def rule_of(constraint: str, rules: Iterable[str]) -> str | None:
    """Return which of some rules a constraint of `building.model_of` belongs to, by its name."""
    fitting = [rule for rule in rules if constraint == rule or constraint.startswith(f"{rule}.")]
    return max(fitting, key=len, default=None)
