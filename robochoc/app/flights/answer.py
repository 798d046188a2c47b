"""Compares a team's answer with its rules: each robot's values, the rules that are broken, and their costs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from robochoc.app.sketch.palette import Applied
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule, Value

Decided = Mapping[tuple[str, str], Value]
"""Values by robot and decision, as `sketch.building.decided` returns them."""


@dataclass(frozen=True)
class Broken:
    """A rule that an answer breaks: for which robots, and what that costs. None: it had to hold."""

    rule: SketchRule
    links: tuple[tuple[str, ...], ...]
    cost: int | None


def broken(sketch: Sketch, values: Decided) -> Iterator[Broken]:
    """Yield the rules that an answer breaks. Robots without a value (they stepped aside) break none."""
    for rule in sketch.rules:
        if not rule.on or rule.kind not in PALETTE:
            continue
        entry, given = PALETTE[rule.kind], Applied(sketch, rule)
        links = tuple(
            robots
            for robots in entry.groups(sketch, rule)
            if all((robot, rule.decision) in values for robot in robots)
            and not entry.holds(given, [values[robot, rule.decision] for robot in robots])
        )
        if links:
            count = sum(map(len, links)) if rule.private else len(links)  # of a private one, each robot counts its own
            yield Broken(rule, links, None if rule.cost is None else rule.cost * count)
