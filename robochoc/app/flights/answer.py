"""Compares a team's answer with its rules: which of them are broken, by whom, and at what cost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from robochoc.app.runs.rule_costs import Decided, violated_links
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule


@dataclass(frozen=True)
class ViolatedRule:
    """A rule that an answer breaks: for which robots, and what that costs. None: it had to hold."""

    rule: SketchRule
    links: tuple[tuple[str, ...], ...]
    cost: int | None


def broken(sketch: Sketch, values: Decided) -> Iterator[ViolatedRule]:
    """Yield the rules that an answer breaks. Robots without a value (they stepped aside) break none."""
    for rule in sketch.rules:
        if rule.on and rule.kind in PALETTE and (links := violated_links(sketch, rule, values)):
            yield ViolatedRule(rule, links, None if rule.cost is None else rule.cost * len(links))
