"""What is told of a sketch that is no team yet, or can hardly be meant."""

from __future__ import annotations

from random import Random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.checks import errors_of, troubles
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Setting, Sketch, SketchRobot, SketchRule
from robochoc.app.sketch.troubles import Trouble, shortened
from robochoc.app.texts import catalogue
from tests.support.brute_force import solutions
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.sketches import random_sketch, spoiled, without_costs

LEVEL = Decision("level", DecisionKind.LEVEL, (1, 2, 3))
TASK = Decision("task", DecisionKind.TASK, ("wash", "dry"), ("North", "South"))
PLACE = Decision("place", DecisionKind.PLACE)
ROBOTS = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate(("North", "South", "East")))
TEAM = Sketch("team", Area(4, 2), ROBOTS, (LEVEL, TASK, PLACE))


Settings = dict[str, Setting]


def with_rule(
    kind: str, decision: str = "level", *robots: str, settings: Settings | None = None, **changes: object
) -> Sketch:
    rule = SketchRule("R1", kind, decision, robots, settings or {})
    return changed(rules=(msgspec.structs.replace(rule, **changes),))


def changed(**changes: object) -> Sketch:
    return msgspec.structs.replace(TEAM, **changes)


def with_decision(**changes: object) -> Sketch:
    return changed(decisions=(msgspec.structs.replace(LEVEL, **changes), TASK, PLACE))


def with_robot(**changes: object) -> Sketch:
    return changed(robots=(msgspec.structs.replace(ROBOTS[0], **changes), *ROBOTS[1:]))


ERRORS: list[tuple[str, Sketch, str]] = [
    ("team-name", changed(name="<b>"), "team"),
    ("map-size", changed(area=Area(0, 3)), "map"),
    ("map-size", changed(area=Area(10**9, 10**9)), "map"),
    ("map-blocked", changed(area=Area(4, 2, frozenset({Cell(9, 9)}))), "map"),
    ("no-robots", Sketch(), "map"),
    ("no-decisions", Sketch(robots=ROBOTS), "team"),
    ("too-many-robots", changed(robots=ROBOTS * 4_000), "team"),
    ("too-many-decisions", changed(decisions=(LEVEL,) * 13), "team"),
    ("too-many-rules", changed(rules=(SketchRule("R1", "different", "level"),) * 2_001), "team"),
    ("too-many-values", with_decision(values=tuple(range(4_001))), "level"),
    ("robot-name", with_robot(name="'); import os"), "'); import os"),
    ("robot-twice", with_robot(name="East"), "East"),
    ("robot-idle", changed(decisions=(TASK,)), "East"),
    ("robot-weight", with_robot(weight=0), "North"),
    ("robot-rank", with_robot(rank=10**9), "North"),
    ("robot-outside", with_robot(at=Cell(4, 0)), "North"),
    ("decision-name", with_decision(name="1"), "1"),
    ("decision-twice", with_decision(name="task"), "task"),
    (
        "decision-clash",
        changed(
            robots=(SketchRobot("a", Cell(0, 0)), SketchRobot("a.b", Cell(0, 0))),
            decisions=(Decision("c", DecisionKind.LEVEL, (1,)), Decision("b.c", DecisionKind.LEVEL, (1,))),
        ),
        "b.c",
    ),
    ("decision-robot-unknown", with_decision(robots=("North", "South", "West")), "level"),
    ("decision-robot-twice", with_decision(robots=("North", "North")), "level"),
    ("decision-empty", with_decision(values=()), "level"),
    ("decision-no-cell", changed(area=Area(1, 1, frozenset({Cell(0, 0)}))), "place"),
    ("decision-no-number", with_decision(values=(1, "two")), "level"),
    ("decision-no-text", with_decision(kind=DecisionKind.TASK), "level"),
    ("decision-text", with_decision(kind=DecisionKind.TASK, values=("a\0",)), "level"),
    ("decision-text", with_decision(kind=DecisionKind.TASK, values=("",)), "level"),
    ("decision-large", with_decision(values=(10**5_000,)), "level"),
    ("decision-outside", with_decision(kind=DecisionKind.PLACE, values=(8,)), "level"),
    (
        "decision-blocked",
        msgspec.structs.replace(
            with_decision(kind=DecisionKind.PLACE, values=(7,)), area=Area(4, 2, frozenset({Cell(3, 1)}))
        ),
        "level",
    ),
    ("decision-value-twice", with_decision(values=(1, 1)), "level"),
    ("rule-name", changed(rules=(SketchRule("{a}", "different", "level"),)), "{a}"),
    ("rule-twice", changed(rules=(SketchRule("R1", "different", "level"),) * 2), "R1"),
    ("rule-kind", with_rule("magic"), "R1"),
    ("rule-decision", with_rule("different", "channel"), "R1"),
    ("rule-fit", with_rule("apart", "task", settings={"gap": 2}), "R1"),
    ("rule-robot-unknown", with_rule("different", "level", "North", "West"), "R1"),
    ("rule-robot-twice", with_rule("different", "level", "North", "North"), "R1"),
    ("rule-robot-idle", with_rule("different", "task", "North", "East"), "R1"),
    ("rule-few", with_rule("different", "level", "North"), "R1"),
    ("rule-many", with_rule("table", "level", settings={"rows": [[1, 2]]}), "R1"),
    ("rule-number", with_rule("apart"), "R1"),
    ("rule-number", with_rule("apart", settings={"gap": 0}), "R1"),
    ("rule-number", with_rule("apart", settings={"gap": "2"}), "R1"),
    ("rule-value", with_rule("never"), "R1"),
    ("rule-value", with_rule("never", settings={"value": 4}), "R1"),
    ("rule-values-none", with_rule("only", settings={"values": []}), "R1"),
    ("rule-values", with_rule("only", settings={"values": [1, 4]}), "R1"),
    ("rule-table-none", with_rule("table", "task", settings={"rows": []}), "R1"),
    ("rule-table-row", with_rule("table", "task", settings={"rows": [["wash"]]}), "R1"),
    ("rule-table-row", with_rule("table", "task", settings={"rows": [["wash", "fly"]]}), "R1"),
    ("rule-cost", with_rule("different", cost=0), "R1"),
    ("rule-private-many", with_rule("at-most", settings={"value": 1, "count": 1}, private=True), "R1"),
    ("rule-private-cost", with_rule("different", private=True, cost=3), "R1"),
]
HINTS: list[tuple[str, Sketch, str]] = [
    ("robot-blocked", changed(area=Area(4, 2, frozenset({Cell(0, 0)}))), "North"),
    (
        "never-crowded",
        changed(
            decisions=(Decision("level", DecisionKind.LEVEL, (1, 2)),), rules=(SketchRule("R1", "different", "level"),)
        ),
        "R1",
    ),
    ("never-at-least", with_rule("at-least", settings={"value": 1, "count": 4}), "R1"),
    ("never-two", with_rule("apart", settings={"gap": 3}), "R1"),
    (
        "robot-large",
        changed(area=Area(60, 60), decisions=(PLACE, Decision("level", DecisionKind.LEVEL, tuple(range(30))))),
        "North",
    ),
]


@looped(("key", "sketch", "element"), ERRORS)
def test_an_error_is_told_at_its_element_with_a_remedy(key: str, sketch: Sketch, element: str) -> None:
    assert troubles(TEAM) == []
    found = [trouble for trouble in troubles(sketch) if trouble.key == f"trouble.{key}"]
    assert [(trouble.element, trouble.is_error) for trouble in found] == [(element, True)]
    assert said_in_full(found[0])


def said_in_full(trouble: Trouble) -> bool:
    """Whether both texts are there, and nothing that they name is left out."""
    holes = [text for text in (trouble.text, trouble.remedy) for name in catalogue_names(trouble) if name in text]
    return bool(trouble.text) and bool(trouble.remedy) and not holes


def catalogue_names(trouble: Trouble) -> list[str]:
    texts = catalogue()[trouble.key] + catalogue()[trouble.remedy_key]
    return [f"{{{part.split('}')[0]}}}" for part in texts.split("{")[1:]]


@looped(("key", "sketch", "element"), HINTS[:1] + HINTS[2:])
def test_a_hint_is_told_at_its_element_with_a_remedy(key: str, sketch: Sketch, element: str) -> None:
    (found,) = troubles(sketch)
    assert (found.key, found.element, found.is_error) == (f"trouble.{key}", element, False)
    assert said_in_full(found)
    assert model_of(sketch).team.robots


def rules(*given: tuple[str, Settings], decision: str = "level") -> Sketch:
    found = (
        SketchRule(f"R{number}", kind, decision, settings=settings) for number, (kind, settings) in enumerate(given, 1)
    )
    return changed(rules=tuple(found))


def test_rules_about_one_robot_that_leave_it_nothing_are_told_at_the_last_of_them() -> None:
    sketch = rules(("only", {"values": [1, 2]}), ("never", {"value": 1}), ("never", {"value": 2}))
    (found,) = troubles(sketch)
    assert (found.key, found.element, found.named["robot"]) == ("trouble.never-alone", "R3", "North")


def test_rules_that_two_robots_cannot_keep_together_are_named() -> None:
    sketch = rules(("apart", {"gap": 2}), ("same", {}))
    (found,) = troubles(sketch)
    assert (found.key, found.named["rules"]) == ("trouble.never-two", "R1, R2")


def test_what_one_robot_is_left_with_counts_for_two() -> None:
    sketch = rules(("only", {"values": [2]}), ("different", {}))
    assert [found.key for found in troubles(sketch)] == ["trouble.never-two"]
    assert troubles(rules(("only", {"values": [1, 3]}), ("leader-above", {}))) == []


def test_the_order_of_two_robots_counts() -> None:
    one = SketchRule("R1", "leader-above", "level", ("North", "South"))
    other = SketchRule("R2", "leader-above", "level", ("South", "North"))
    assert [found.key for found in troubles(changed(rules=(one, other)))] == ["trouble.never-two"]
    assert troubles(changed(rules=(one, msgspec.structs.replace(other, robots=("South", "East"))))) == []


def test_a_rule_that_does_not_count_is_not_told() -> None:
    assert troubles(with_rule("magic", on=False)) == []


def test_too_many_constraints_are_told_at_the_rule_with_which_they_are_too_many() -> None:
    robots = tuple(SketchRobot(f"D{number}", Cell(number % 60, number // 60)) for number in range(1_000))
    sketch = Sketch("team", Area(60, 60), robots, (LEVEL,), (SketchRule("R1", "different", "level"),))
    (found,) = troubles(sketch)
    assert (found.key, found.element, found.named["count"]) == ("trouble.rule-links", "R1", 499_500)
    near = SketchRule("R1", "neighbours-different", "level", settings={"radius": 1})
    assert troubles(msgspec.structs.replace(sketch, rules=(near,))) == []


@given(st.integers(0, 10**9))
@examples(150)
def test_what_has_no_error_is_a_team(seed: int) -> None:
    random = Random(seed)
    sketch = without_costs(random_sketch(random)) if seed % 3 else random_sketch(random)
    for _ in range(seed % 4):
        sketch = spoiled(random, sketch)
    found = troubles(sketch)
    assert all(said_in_full(trouble) for trouble in found)
    if not any(trouble.is_error for trouble in found):
        assert model_of(sketch).team.robots


@given(st.integers(0, 10**9))
@examples(60)
def test_what_is_sound_has_no_error(seed: int) -> None:
    sketch = without_costs(random_sketch(Random(seed)))
    assert [trouble for trouble in troubles(sketch) if trouble.is_error] == []


@given(st.integers(0, 10**9))
@examples(60)
def test_errors_are_found_without_the_hints_that_take_long(seed: int) -> None:
    random = Random(seed)
    sketch = random_sketch(random)
    for _ in range(seed % 3):
        sketch = spoiled(random, sketch)
    errors = [trouble for trouble in troubles(sketch) if trouble.is_error]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("robochoc.app.sketch.checks.hopeless", None)
        assert errors_of(sketch) == errors


@given(st.integers(0, 10**9))
@examples(250)
def test_what_is_said_never_to_hold_never_holds(seed: int) -> None:
    sketch = random_sketch(Random(seed))
    hard = tuple(msgspec.structs.replace(rule, cost=None, private=False) for rule in sketch.rules)
    sketch = msgspec.structs.replace(sketch, rules=tuple(rule for rule in hard if not PALETTE[rule.kind].graded))
    if any(trouble.key.startswith("trouble.never-") for trouble in troubles(sketch)):
        assert next(solutions(model_of(sketch).team), None) is None


def test_every_text_has_a_remedy() -> None:
    keys = [key for key in catalogue() if key.startswith("trouble.")]
    texts = {key for key in keys if not key.endswith("-remedy")}
    assert {f"{key}-remedy" for key in texts} == set(keys) - texts
    assert {f"trouble.{key}" for key, _, _ in (*ERRORS, *HINTS)} | {
        "trouble.never-alone",
        "trouble.rule-links",
        "trouble.rule-private-off",  # these two are told at a switch, before the mistake can be made
        "trouble.rule-cost-off",
    } == texts


def test_what_is_long_is_shortened() -> None:
    assert max(len(shortened(long)) for long in ("a" * 100, 10**5_000, -(10**5_000))) <= 60
