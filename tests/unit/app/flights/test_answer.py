"""An answer held against the rules of a sketch: what it breaks is what the model says it costs."""

from __future__ import annotations

import itertools
from random import Random

from robochoc.app.flights.report import violated_rules
from robochoc.app.sketch import edits
from robochoc.app.sketch.sketch import Cell, Decision, DecisionKind, Sketch, SketchRule
from tests.support.cases import looped
from tests.support.sketches import random_sketch


def _pair(*rules: SketchRule) -> Sketch:
    sketch = Sketch()
    for column in range(3):
        sketch = edits.with_robot(sketch, Cell(column, 0))
    sketch = edits.with_decision(sketch, Decision("level", DecisionKind.LEVEL, (1, 2, 3)))
    for rule in rules:
        sketch = edits.with_rule(sketch, rule)
    return sketch


ALL_ONE = {(f"Drone{number}", "level"): 1 for number in (1, 2, 3)}


def test_what_had_to_hold_has_no_cost() -> None:
    found = [*violated_rules(_pair(SketchRule("", "different", "level")), ALL_ONE)]
    assert [(one.links, one.cost) for one in found] == [
        ((("Drone1", "Drone2"), ("Drone1", "Drone3"), ("Drone2", "Drone3")), None)
    ]


def test_each_link_costs_also_of_a_private_rule() -> None:
    rule = SketchRule("", "different", "level", cost=5)
    assert [one.cost for one in violated_rules(_pair(rule), ALL_ONE)] == [15]
    private = SketchRule("", "different", "level", cost=5, private=True)
    assert [one.cost for one in violated_rules(_pair(private), ALL_ONE)] == [15]


def test_who_stepped_aside_and_what_is_switched_off_break_nothing() -> None:
    assert [*violated_rules(_pair(SketchRule("", "different", "level")), {("Drone1", "level"): 1})] == []
    assert [*violated_rules(_pair(SketchRule("", "different", "level", on=False)), ALL_ONE)] == []


@looped("seed", range(30))
def test_that_every_kind_of_rule_can_be_asked(seed: int) -> None:
    random = Random(seed)
    sketch = random_sketch(random)
    names = [(robot, one) for one in sketch.decisions for robot in sketch.deciders(one)]
    spaces = [random.sample([*sketch.values(one)], min(2, len(sketch.values(one)))) for _, one in names]
    for values in itertools.islice(itertools.product(*spaces), 20):
        answer = {(robot, one.name): value for (robot, one), value in zip(names, values, strict=True)}
        for one in violated_rules(sketch, answer):
            assert one.rule.on
            assert set(itertools.chain.from_iterable(one.links)) <= {robot.name for robot in sketch.robots}
            assert (one.cost is None) == (one.rule.cost is None)
