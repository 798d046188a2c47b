"""Compares a team's answer with its rules: which of them are broken, by whom, and at what cost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from robochoc.app.runs.paid import Decided, broken_links
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule


@dataclass(frozen=True)
class Broken:
    """A rule that an answer breaks: for which robots, and what that costs. None: it had to hold."""

    rule: SketchRule
    links: tuple[tuple[str, ...], ...]
    cost: int | None


def broken(sketch: Sketch, values: Decided) -> Iterator[Broken]:
    """Yield the rules that an answer breaks. Robots without a value (they stepped aside) break none."""
    for rule in sketch.rules:
        if rule.on and rule.kind in PALETTE and (links := broken_links(sketch, rule, values)):
            yield Broken(rule, links, None if rule.cost is None else rule.cost * len(links))
