"""Small random sketches whose rules are often in each other's way, and their solutions by trying all."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from random import Random

import msgspec

from robochoc.app.conflicts.rules import with_only
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Cell, Decision, DecisionKind, Setting, Sketch, SketchRobot, SketchRule, Value

NAMES = ("A", "B", "C")
_KINDS = ("different", "same", "apart", "close", "in-order", "only", "never", "at-least", "at-most", "table")
_OF_ALL = ("at-least", "at-most")
_OF_NAMES = ("different", "same", "only", "never", "at-least", "at-most", "table")


def random_rules(random: Random) -> Sketch:
    """Return a sketch of three robots with three values and up to six rules, some soft or switched off."""
    numbers = random.random() < 0.6
    values: tuple[int | str, ...] = (1, 2, 3) if numbers else ("wash", "two words", "dry")
    decision = Decision("d", DecisionKind.SLOT if numbers else DecisionKind.TASK, values)
    robots = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate(NAMES))
    rules = []
    for number in range(random.randint(1, 6)):
        kind = random.choice(_KINDS if numbers else _OF_NAMES)
        bound = tuple(random.sample(NAMES, 2 if kind == "table" else random.randint(2, 3)))
        every: list[Value | list[Value]] = [[one, other] for one in values for other in values]
        pairs = random.sample(every, random.randint(1, 4))
        settings: dict[str, Setting] = {
            "gap": random.randint(1, 2),
            "value": random.choice(values),
            "values": [*random.sample(values, random.randint(1, 2))],
            "count": random.randint(1, 2),
            "rows": pairs,
        }
        rule = SketchRule(f"R{number + 1}", kind, "d", bound, settings, random.choice((None, None, None, 4)))
        rules.append(
            msgspec.structs.replace(
                rule, on=random.random() < 0.9, private=random.random() < 0.2 and kind not in _OF_ALL
            )
        )
    return Sketch("team", robots=robots, decisions=(decision,), rules=tuple(rules))


def can_hold(sketch: Sketch, rules: Collection[str]) -> bool:
    """Return whether rules of a sketch can hold together, by trying all values."""
    team = model_of(with_only(sketch, rules)).team
    constraints = [*team.constraints()]
    return any(all(one.allows(values) for one in constraints) for values in _all(team.variables))


def _all(variables: object) -> Iterator[dict[str, int]]:
    assert isinstance(variables, dict)
    names = [*variables]
    for values in itertools.product(*(variables[name].domain for name in names)):
        yield dict(zip(names, values, strict=True))
