"""Finds the family of random problems most similar to a sketch: equal numbers of robots, values and links."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import msgspec

from robochoc.app.sketch.palette import Applied, Links
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch, SketchRule, Value

Option = int | float | str | list[int] | list[float]
_MOST_SAMPLED = 60
"""The maximum number of values whose pairs are all checked. Of more values, this many are sampled evenly."""
_COLOURINGS = frozenset({"different", "neighbours-different"})
_STEP = 0.1
_LEAST, _MOST = 0.02, 0.9
MOST_VALUES = 1_000
_PAIR = 2


class Family(msgspec.Struct, frozen=True):
    """A family of problems for `robochoc generate`.

    Attributes:
        name: The family's name.
        options: The options, as in a study's file: a list means each of its values.
        key: The key of the family's description in the catalogue.
        named: The arguments of the description.
        points: The number of combinations of the options.
    """

    name: str
    options: dict[str, Option]
    key: str
    named: dict[str, Value | float]
    points: int


def family_of(sketch: Sketch) -> Family | None:
    """Return the family that is most similar to a sketch, or None if there is none, for instance without links."""
    if len(sketch.decisions) != 1 or len(sketch.robots) < _PAIR:
        return None
    (decision,) = sketch.decisions
    values, robots = sketch.values(decision), sketch.deciders(decision)
    rules = [rule for rule in sketch.rules if rule.on]
    linked = _linked(sketch, rules)
    if len(robots) != len(sketch.robots) or not linked or not _PAIR <= len(values) <= MOST_VALUES:
        return None
    if len(rules) == 1 and rules[0].kind in _COLOURINGS:
        return _colouring(len(robots), len(values), len(linked), hard=rules[0].cost is None)
    return _random(sketch, values, linked)


def _colouring(agents: int, values: int, links: int, *, hard: bool) -> Family:
    degree = round(2 * links / agents, 2)
    colours = [colours for colours in (values - 1, values, values + 1) if colours > 1]
    options: dict[str, Option] = {"agents": agents, "degree": degree, "colors": colours}
    options["conflicts"] = "hard" if hard else "soft"
    named: dict[str, Value | float] = {"agents": agents, "values": values, "degree": f"{degree:g}"}
    key = "compare.family-coloring" if hard else "compare.family-coloring-soft"
    return Family("coloring", options, key, named, len(colours))


def _random(sketch: Sketch, values: tuple[Value, ...], linked: dict[frozenset[str], list[_Turned]]) -> Family:
    agents = len(sketch.robots)
    density = round(2 * len(linked) / (agents * (agents - 1)), 3)
    known: dict[tuple[tuple[str, bool], ...], float] = {}
    for said in linked.values():
        key = tuple((rule.id, turned) for rule, turned in said)
        if key not in known:
            known[key] = _forbidden(sketch, _spread(values), said)
    of_each = [known[tuple((rule.id, turned) for rule, turned in said)] for said in linked.values()]
    tightness = round(sum(of_each) / len(of_each), 2)
    costs = [rule.cost or 1 for rule in sketch.rules if rule.on and _costs(rule)]
    options: dict[str, Option] = {"agents": agents, "domain": len(values), "density": density}
    points = sorted({round(min(max(tightness + step, _LEAST), _MOST), 2) for step in (-_STEP, 0, _STEP)})
    options["tightness"] = points
    words = "compare.family-random"
    if costs:
        options["max_cost"] = max(costs)
        words = "compare.family-random-costs"
    named: dict[str, Value | float] = {"agents": agents, "values": len(values)}
    named |= {"density": f"{100 * density:.0f}", "tightness": f"{100 * tightness:.0f}"}
    named |= {"cost": max(costs)} if costs else {}
    return Family("random", options, words, named, len(points))


_Turned = tuple[SketchRule, bool]
"""A rule between two robots, and whether their order in the rule is the reverse of their names' order."""


def _linked(sketch: Sketch, rules: list[SketchRule]) -> dict[frozenset[str], list[_Turned]]:
    """Return the rules between each pair of robots with a common rule."""
    found: dict[frozenset[str], list[_Turned]] = {}
    for rule, (one, other) in _pairs(sketch, rules):
        found.setdefault(frozenset((one, other)), []).append((rule, one > other))
    return found


def _pairs(sketch: Sketch, rules: list[SketchRule]) -> Iterator[tuple[SketchRule, tuple[str, str]]]:
    for rule in rules:
        if PALETTE[rule.kind].links not in {Links.EACH, Links.GROUP}:
            for one, other in PALETTE[rule.kind].groups(sketch, rule):
                yield rule, (one, other)


def _forbidden(sketch: Sketch, values: list[Value], said: list[_Turned]) -> float:
    """Return the share of pairs of values forbidden by hard rules."""
    hard = [(PALETTE[rule.kind], Applied(sketch, rule), turned) for rule, turned in said if rule.cost is None]
    kept = sum(
        all(entry.holds(given, pair[::-1] if turned else pair) for entry, given, turned in hard)
        for pair in product(values, repeat=_PAIR)
    )
    return 1 - kept / (len(values) * len(values))


def _spread(values: tuple[Value, ...]) -> list[Value]:
    step = max(1, -(-len(values) // _MOST_SAMPLED))
    return [*values[::step]]


def _costs(rule: SketchRule) -> bool:
    return rule.cost is not None or PALETTE[rule.kind].graded
