"""Each rule of the palette against its plain meaning, which is written here once more, and against what is private."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from itertools import permutations
from random import Random
from typing import Any

import msgspec
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.checks import troubles
from robochoc.app.sketch.files import xml_sources
from robochoc.app.sketch.palette import Applied
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.model.problem import INFINITE
from tests.support.brute_force import solutions
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.sketches import random_sketch, without_costs

Settings = dict[str, Any]


class Drawn:
    """What a rule is about, as plain values: the robots that it binds, in its order, and what they have decided."""

    def __init__(self, sketch: Sketch, rule: SketchRule, values: dict[str, Any]) -> None:
        decision = sketch.decision(rule.decision)
        assert decision is not None
        self.columns = sketch.area.columns
        self.is_place = decision.kind is DecisionKind.PLACE
        self.robots = list(rule.robots or sketch.deciders(decision))
        self.at = {robot.name: robot.at for robot in sketch.robots}
        self.values = values
        self.settings: Settings = dict(rule.settings)

    def distance(self, one: str, other: str) -> float:
        """How far what two have decided is apart."""
        a, b = self.values[one], self.values[other]
        if not self.is_place:
            return float(abs(a - b))
        return math.dist((a % self.columns, a // self.columns), (b % self.columns, b // self.columns))

    def steps_to_wish(self, robot: str) -> int:
        """How many steps what a robot has decided is away from the rule's value: on the map, across and along."""
        a, b = self.values[robot], self.settings["value"]
        if not self.is_place:
            return int(abs(a - b))
        return int(abs(a % self.columns - b % self.columns) + abs(a // self.columns - b // self.columns))

    def pairs(self) -> list[tuple[str, str]]:
        return [*itertools.combinations(self.robots, 2)]

    def near(self) -> list[tuple[str, str]]:
        """Pairs that stand within the radius."""
        return [
            (one, other)
            for one, other in self.pairs()
            if math.dist(msgspec.structs.astuple(self.at[one]), msgspec.structs.astuple(self.at[other]))
            <= self.settings["radius"]
        ]

    def followers(self) -> list[tuple[str, str]]:
        return [(self.robots[0], other) for other in self.robots[1:]]


def far(drawn: Drawn, pairs: Sequence[tuple[str, str]]) -> int:
    return sum(drawn.distance(one, other) > drawn.settings["gap"] for one, other in pairs)


def narrow(drawn: Drawn, pairs: Sequence[tuple[str, str]]) -> int:
    return sum(drawn.distance(one, other) < drawn.settings["gap"] for one, other in pairs)


def alike(drawn: Drawn, pairs: Sequence[tuple[str, str]]) -> int:
    return sum(drawn.values[one] == drawn.values[other] for one, other in pairs)


def row(drawn: Drawn, robot: str) -> int:
    return int(drawn.values[robot]) // drawn.columns


def column(drawn: Drawn, robot: str) -> int:
    return int(drawn.values[robot]) % drawn.columns


def takers(drawn: Drawn) -> int:
    return [drawn.values[robot] for robot in drawn.robots].count(drawn.settings["value"])


BROKEN: dict[str, Callable[[Drawn], int]] = {
    "different": lambda d: alike(d, d.pairs()),
    "apart": lambda d: narrow(d, d.pairs()),
    "neighbours-different": lambda d: alike(d, d.near()),
    "neighbours-apart": lambda d: narrow(d, d.near()),
    "neighbours-close": lambda d: far(d, d.near()),
    "close": lambda d: far(d, d.pairs()),
    "same": lambda d: len(d.pairs()) - alike(d, d.pairs()),
    "leader-above": lambda d: sum(d.values[lead] <= d.values[other] for lead, other in d.followers()),
    "leader-close": lambda d: far(d, d.followers()),
    "in-order": lambda d: sum(d.values[a] >= d.values[b] for a, b in zip(d.robots, d.robots[1:], strict=False)),
    "north-of": lambda d: sum(row(d, lead) <= row(d, other) for lead, other in d.followers()),
    "east-of": lambda d: sum(column(d, lead) <= column(d, other) for lead, other in d.followers()),
    "only": lambda d: sum(d.values[robot] not in d.settings["values"] for robot in d.robots),
    "never": lambda d: sum(d.values[robot] == d.settings["value"] for robot in d.robots),
    "prefers": lambda d: sum(d.values[robot] != d.settings["value"] for robot in d.robots),
    "at-most": lambda d: int(takers(d) > d.settings["count"]),
    "at-least": lambda d: int(takers(d) < d.settings["count"]),
    "table": lambda d: int([d.values[robot] for robot in d.robots] not in d.settings["rows"]),
}
"""How often a rule is broken: the number of its links that do not hold."""
CHARGED: dict[str, Callable[[Drawn], int]] = {
    "rather": lambda d: sum(d.steps_to_wish(robot) * d.settings["step"] for robot in d.robots),
    "little": lambda d: sum(d.values[robot] * d.settings["step"] for robot in d.robots),
}
"""What a graded rule costs."""


def meant(sketch: Sketch, rule: SketchRule, values: dict[str, Any]) -> float:
    """What a rule costs by its plain meaning."""
    drawn = Drawn(sketch, rule, values)
    if rule.kind in CHARGED:
        return CHARGED[rule.kind](drawn)
    broken = BROKEN[rule.kind](drawn)
    return broken * rule.cost if rule.cost is not None else INFINITE if broken else 0


def test_every_rule_has_a_plain_meaning() -> None:
    assert {*BROKEN, *CHARGED} == {*PALETTE}
    assert {key for key, entry in PALETTE.items() if entry.graded} == {*CHARGED}


@looped("kind", PALETTE)
@given(seed=st.integers(0, 10**9))
@examples(6)
def test_a_rule_is_what_it_says(kind: str, seed: int) -> None:
    random = Random(seed)
    sketch = without_costs(random_sketch(random, [kind]))
    model = model_of(sketch)
    constraints = [*model.team.constraints()]
    for _ in range(25):
        chosen = {
            decision.name: {robot: random.choice(sketch.values(decision)) for robot in sketch.deciders(decision)}
            for decision in sketch.decisions
        }
        coded = {}
        for name, values in chosen.items():
            for robot, value in values.items():
                variable = model.robots[robot][name]
                coded[variable.name] = variable.codes.code(value)
        assignment = {name: code for name, code in coded.items() if code is not None}
        assert len(assignment) == len(coded)
        expected = sum(meant(sketch, rule, chosen[rule.decision]) for rule in sketch.rules if rule.on)
        total: float = sum(robot.costs.constant for robot in model.team.robots)
        total += sum(constraint.price(assignment) for constraint in constraints)
        assert total == expected


@looped("kind", PALETTE)
@given(seed=st.integers(0, 10**9))
@examples(6)
def test_over_values_a_rule_is_true_or_false(kind: str, seed: int) -> None:
    random = Random(seed)
    sketch = random_sketch(random, [kind])
    for rule in sketch.rules:
        decision = sketch.decision(rule.decision)
        assert decision is not None
        values = {robot: random.choice(sketch.values(decision)) for robot in sketch.deciders(decision)}
        entry, applied = PALETTE[kind], Applied(sketch, rule)
        lost = [
            robots
            for robots in entry.groups(sketch, rule)
            if not entry.holds(applied, [values[robot] for robot in robots])
        ]
        assert len(lost) == (0 if entry.graded else BROKEN[kind](Drawn(sketch, rule, values)))


@given(st.integers(0, 10**9))
@examples(40)
def test_neighbours_are_those_within_the_radius_in_order(seed: int) -> None:
    random = Random(seed)
    cells = [Cell(random.randrange(20), random.randrange(20)) for _ in range(random.randrange(30))]
    names = [f"D{number}" for number in range(len(cells))]
    random.shuffle(names)
    robots = tuple(SketchRobot(f"D{number}", cell) for number, cell in enumerate(cells))
    radius = random.randint(1, 25)
    rule = SketchRule("R1", "neighbours-different", "level", tuple(names), {"radius": radius})
    sketch = Sketch("team", Area(20, 20), robots, (Decision("level", DecisionKind.LEVEL, (1, 2)),), (rule,))
    drawn = Drawn(sketch, rule, {})
    assert [*PALETTE[rule.kind].groups(sketch, rule)] == drawn.near()


ROBOTS = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate(("Ann", "Bob", "Cid")))
LEVEL = Decision("level", DecisionKind.LEVEL, (1, 2, 3))
PRIVATE = (
    SketchRule("R1", "apart", "level", ("Ann", "Bob"), {"gap": 2}, private=True),
    SketchRule("R2", "leader-above", "level", ("Cid", "Ann", "Bob"), private=True),
    SketchRule("R3", "different", "level"),
)


def test_of_two_only_the_first_has_a_private_rule_in_its_file() -> None:
    sketch = Sketch("team", Area(4, 2), ROBOTS, (LEVEL,), PRIVATE)
    files = xml_sources(sketch)
    parts = {
        (file, constraint.get("name")): constraint.get("reference")
        for file, text in files.items()
        for constraint in etree.fromstring(text.encode()).iter("constraint")
        if constraint.get("model") == "PKC"
    }
    anything = "anything2"
    assert parts == {
        ("Ann.xml", "R1.Ann.Bob"): "P1",
        ("Bob.xml", "R1.Ann.Bob"): anything,
        ("Cid.xml", "R2.Cid.Ann"): "gt",
        ("Ann.xml", "R2.Cid.Ann"): anything,
        ("Cid.xml", "R2.Cid.Bob"): "gt",
        ("Bob.xml", "R2.Cid.Bob"): anything,
    }
    assert "abs" not in files["Bob.xml"] + files["Cid.xml"]


@given(st.integers(0, 10**9))
@examples(10)
def test_the_protocol_that_is_chosen_keeps_secrets_and_is_right(seed: int) -> None:
    random = Random(seed)
    sketch = random_sketch(random, ["different", "apart", "close", "leader-above", "table", "same", "in-order"])
    rules = tuple(msgspec.structs.replace(rule, cost=None, private=True) for rule in sketch.rules)
    sketch = msgspec.structs.replace(sketch, rules=rules)
    model = model_of(sketch)
    outcome = model.solve(runtime="simulator")
    linked = [one for rule in rules if rule.on for one in PALETTE[rule.kind].groups(sketch, rule)]
    assert outcome.protocol in ({"disfc", "abt"} if linked else {outcome.protocol})
    assert (outcome.verdict == "solution") == (next(solutions(model.team), None) is not None)


# Near places


def test_near_places_are_preferred_step_by_step() -> None:
    area = Area(7, 5)
    homes = {"A": Cell(0, 0), "B": Cell(6, 0), "C": Cell(3, 4)}
    free = [Cell(1, 1), Cell(5, 2), Cell(3, 3), Cell(6, 4)]
    forbidden = area.number(free[0])
    rules = [SketchRule("R1", "different", "place"), SketchRule("R2", "never", "place", ("A",), {"value": forbidden})]
    for name, home in homes.items():
        settings = {"value": area.number(home), "step": 2}
        rules.append(SketchRule(f"R{len(rules) + 1}", "rather", "place", (name,), {**settings}))
    values = tuple(area.number(cell) for cell in [*free, *homes.values()])
    robots = tuple(SketchRobot(name, cell) for name, cell in homes.items())
    never_home = tuple(
        SketchRule(f"H{number}", "never", "place", (), {"value": area.number(cell)})
        for number, cell in enumerate(homes.values())
    )
    sketch = Sketch("near", area, robots, (Decision("place", DecisionKind.PLACE, values),), (*rules, *never_home))
    assert not [trouble for trouble in troubles(sketch) if trouble.is_error]
    best = min(
        sum(2 * (abs(cell.x - home.x) + abs(cell.y - home.y)) for cell, home in zip(some, homes.values(), strict=True))
        for some in permutations(free, 3)
        if area.number(some[0]) != forbidden
    )
    assert model_of(sketch).solve("syncbb", runtime="simulator").cost == best
