"""Random sketches: sound ones, with every rule of the palette, and others in which something is wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random

import msgspec

from robochoc.app.sketch.palette import Form, Links, RuleField
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import (
    NUMBERED,
    Area,
    Cell,
    Decision,
    DecisionKind,
    Setting,
    Sketch,
    SketchRobot,
    SketchRule,
)

NAMES = ("North", "South", "Drone1", "Drone10", "a.b", "a", "b.c", "x_y", "in")
TEXTS = ("wash", "dry", "two words", "1", "{a}", "it's", '"', "<b>", "for")
DECISIONS = ("level", "class", "b", "a.b", "a_b", "robots")


def random_sketch(random: Random, kinds: list[str] | None = None) -> Sketch:
    """Return a sketch with at most four robots and six values a decision, with rules of these kinds or any."""
    area = Area(random.randint(1, 4), random.randint(1, 3))
    cells = [area.cell(number) for number in area.free]
    blocked = random.sample(cells, random.randint(0, len(cells) // 3))
    area = Area(area.columns, area.rows, frozenset(blocked))
    names = random.sample(NAMES, random.randint(1, 4))
    robots = tuple(
        SketchRobot(name, random.choice(cells), random.choice((1, 1, 5)), random.choice((0, 0, 3, -2)))
        for name in names
    )
    chosen = random.sample(DECISIONS, random.randint(1, 2))
    decisions = tuple(_decision(random, area, name, names, whole=number == 0) for number, name in enumerate(chosen))
    sketch = Sketch("team", area, robots, decisions)
    for number in range(random.randint(0, 4)):
        rule = _rule(random, sketch, f"R{number + 1}", kinds or [*PALETTE])
        if rule is not None:
            sketch = msgspec.structs.replace(sketch, rules=(*sketch.rules, rule))
    return sketch


def _decision(random: Random, area: Area, name: str, robots: list[str], *, whole: bool) -> Decision:
    kind = random.choice([*DecisionKind])
    values: Sequence[int | str]
    if kind is DecisionKind.PLACE:
        values = random.sample(area.free, random.randint(0, len(area.free)))
    elif kind in NUMBERED:
        low = random.randint(-1, 3)
        values = range(low, low + random.randint(1, 5)) if random.random() < 0.5 else random.sample(range(-3, 20), 4)
    else:
        values = random.sample(TEXTS, random.randint(1, 5))
    who = () if whole else tuple(random.sample(robots, random.randint(1, len(robots))))
    return Decision(name, kind, tuple(values), who)


def _rule(random: Random, sketch: Sketch, name: str, kinds: list[str]) -> SketchRule | None:
    decision = random.choice(sketch.decisions)
    deciders = sketch.deciders(decision)
    fitting = [key for key in kinds if decision.kind in PALETTE[key].kinds and PALETTE[key].fewest <= len(deciders)]
    if not fitting:
        return None
    entry = PALETTE[random.choice(fitting)]
    most = min(entry.most or len(deciders), len(deciders))
    robots = tuple(random.sample(deciders, random.randint(entry.fewest, most)))
    if len(deciders) <= most and random.random() < 0.4:
        robots = ()
    settings = {one.name: _setting(random, one, sketch.values(decision)) for one in entry.openings}
    cost = random.choice((None, None, random.randint(1, 9)))
    private = (entry.links is not Links.GROUP or len(robots) == 2) and random.random() < 0.2
    return SketchRule(name, entry.key, decision.name, robots, settings, cost, private, random.random() > 0.1)


def _setting(random: Random, opening: RuleField, values: tuple[int | str, ...]) -> Setting:
    match opening.form:
        case Form.NUMBER:
            return random.randint(opening.least, opening.least + 3)
        case Form.VALUE:
            return random.choice(values)
        case Form.VALUES:
            return random.sample(values, random.randint(1, len(values)))
        case Form.TABLE:
            return [[random.choice(values), random.choice(values)] for _ in range(random.randint(1, 6))]


def without_costs(sketch: Sketch) -> Sketch:
    """Return a sketch whose private rules can be kept: without costs. One without private rules stays as it is."""
    if not any(rule.private for rule in sketch.rules):
        return sketch
    rules = tuple(msgspec.structs.replace(rule, cost=None) for rule in sketch.rules if not PALETTE[rule.kind].graded)
    return msgspec.structs.replace(sketch, rules=rules)


def spoiled(random: Random, sketch: Sketch) -> Sketch:
    """Return a sketch in which something was changed, which it may not take."""
    if not sketch.robots or not sketch.decisions:
        return sketch
    return random.choice(_FAULTS)(random, sketch)


Fault = Callable[[Random, Sketch], Sketch]
HOSTILE = ("", " ", "1a", "scenario", "<script>", "'); import os", "{x}", "a" * 70, "\u202e", "\0", "a\nb")


def _changes(*changes: dict[str, object]) -> tuple[dict[str, object], ...]:
    return changes


def _of_robot(random: Random, sketch: Sketch) -> Sketch:
    place = random.randrange(len(sketch.robots))
    changes = random.choice(
        _changes(
            {"name": random.choice((*HOSTILE, sketch.robots[0].name))},
            {"at": Cell(random.randint(-1, 9), 10**30)},
            {"weight": random.choice((0, -1, 10**40))},
            {"rank": 10**40},
        )
    )
    robots = [*sketch.robots]
    robots[place] = msgspec.structs.replace(robots[place], **changes)
    return msgspec.structs.replace(sketch, robots=tuple(robots))


def _of_decision(random: Random, sketch: Sketch) -> Sketch:
    place = random.randrange(len(sketch.decisions))
    old = sketch.decisions[place]
    changes = random.choice(
        _changes(
            {"name": random.choice((*HOSTILE, sketch.decisions[0].name, "b.level"))},
            {"kind": random.choice([*DecisionKind])},
            {"values": ()},
            {"values": (*old.values, random.choice((*HOSTILE, 10**30, -1, 99)))},
            {"values": old.values * 2},
            {"robots": (*old.robots, random.choice(NAMES))},
        )
    )
    decisions = [*sketch.decisions]
    decisions[place] = msgspec.structs.replace(old, **changes)
    return msgspec.structs.replace(sketch, decisions=tuple(decisions))


def _of_rule(random: Random, sketch: Sketch) -> Sketch:
    if not sketch.rules:
        return sketch
    place = random.randrange(len(sketch.rules))
    old = sketch.rules[place]
    bad: list[Setting] = [0, 10**40, "no", [], ["no"], [[]], [[1]], [[1, 2, 3]]]
    settings = {name: random.choice(bad) for name in old.settings}
    changes = random.choice(
        _changes(
            {"id": random.choice((*HOSTILE, sketch.rules[0].id))},
            {"kind": random.choice((*PALETTE, "unknown"))},
            {"decision": random.choice(DECISIONS)},
            {"robots": (*old.robots, random.choice(NAMES))},
            {"robots": old.robots[:1]},
            {"settings": settings},
            {"settings": {}},
            {"cost": random.choice((0, -3, 10**40))},
            {"private": True},
        )
    )
    rules = [*sketch.rules]
    rules[place] = msgspec.structs.replace(old, **changes)
    return msgspec.structs.replace(sketch, rules=tuple(rules))


def _of_sketch(random: Random, sketch: Sketch) -> Sketch:
    changes = random.choice(
        _changes(
            {"name": random.choice(HOSTILE)},
            {"robots": sketch.robots[1:]},
            {"robots": ()},
            {"decisions": sketch.decisions[1:]},
            {"area": Area(random.choice((0, 1, 2, 10**9)), 2, sketch.area.blocked)},
            {"area": Area(4, 3, frozenset({*sketch.area.blocked, Cell(0, 0), Cell(1, 0), Cell(1, 1)}))},
        )
    )
    return msgspec.structs.replace(sketch, **changes)


_FAULTS: tuple[Fault, ...] = (_of_robot, _of_decision, _of_rule, _of_rule, _of_sketch)
