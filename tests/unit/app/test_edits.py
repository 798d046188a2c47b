"""Edits of a sketch, and taking them back: whatever is edited, nothing is left that points to nothing."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.app.sketch import edits
from robochoc.app.sketch import sketch as limits
from robochoc.app.sketch.checks import troubles
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.history import MAX_STEPS, History
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.texts import say
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.sketches import HOSTILE, random_sketch

ROBOTS = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate(("Ann", "Bob", "Cid")))
DECISIONS = (
    Decision("level", DecisionKind.LEVEL, (1, 2, 3)),
    Decision("task", DecisionKind.TASK, ("wash", "dry"), ("Ann",)),
)
RULES = (
    SketchRule("R1", "different", "level"),
    SketchRule("R2", "leader-above", "level", ("Ann", "Bob")),
    SketchRule("R3", "never", "level", ("Ann",), {"value": 1}),
    SketchRule("R4", "only", "task", (), {"values": ["dry"]}),
)
TEAM = Sketch("team", Area(4, 2), ROBOTS, DECISIONS, RULES)
POINTING = {
    "trouble.decision-robot-unknown",
    "trouble.rule-decision",
    "trouble.rule-robot-unknown",
    "trouble.robot-outside",
    "trouble.map-blocked",
}
"""What is told of what points to nothing. (A decision may be changed so that rules no longer fit it.)"""


def ids(sketch: Sketch) -> list[str]:
    return [rule.id for rule in sketch.rules]


def test_a_robot_gets_a_free_name() -> None:
    one = edits.with_robot(TEAM, Cell(1, 1))
    two = edits.with_robot(one, Cell(1, 1))
    assert [robot.name for robot in two.robots[3:]] == ["Drone1", "Drone2"]
    assert edits.with_robot(TEAM, Cell(1, 1), " Dan ").robots[-1] == SketchRobot("Dan", Cell(1, 1))


def test_with_a_robot_goes_what_is_about_it_alone() -> None:
    sketch = edits.without_robot(TEAM, "Ann")
    assert [robot.name for robot in sketch.robots] == ["Bob", "Cid"]
    assert [decision.name for decision in sketch.decisions] == ["level"]
    assert [(rule.id, rule.robots) for rule in sketch.rules] == [("R1", ()), ("R2", ("Bob",))]


def test_a_robot_is_renamed_everywhere() -> None:
    sketch = edits.with_robot_renamed(TEAM, "Ann", "Zoe")
    assert "Ann" not in str(sketch)
    assert sketch.rules[1].robots == ("Zoe", "Bob")
    assert sketch.decisions[1].robots == ("Zoe",)


def test_with_a_decision_go_its_rules_and_they_follow_its_name() -> None:
    assert ids(edits.without_decision(TEAM, "level")) == ["R4"]
    renamed = edits.with_decision(TEAM, Decision("height", DecisionKind.LEVEL, (1, 1, 2)), instead_of="level")
    assert [rule.decision for rule in renamed.rules] == ["height", "height", "height", "task"]
    assert renamed.decisions[0].values == (1, 2)


def test_rules_are_added_changed_switched_and_removed() -> None:
    more = edits.with_rule(TEAM, SketchRule("", "same", "level"))
    assert ids(more)[-1] == "R5"
    changed = edits.with_rule(more, SketchRule("R5", "same", "level", cost=3))
    assert (ids(changed), changed.rules[-1].cost) == (ids(more), 3)
    assert not edits.with_rule_switched(more, "R5", on=False).rules[-1].on
    assert edits.without_rule(more, "R5") == TEAM


def test_weights_and_ranks_are_changed() -> None:
    assert edits.with_importance(TEAM, "Ann", weight=5).robots[0] == SketchRobot("Ann", Cell(0, 0), 5)
    assert edits.with_importance(TEAM, "Ann", rank=-2).robots[0] == SketchRobot("Ann", Cell(0, 0), 1, -2)


def test_cells_are_blocked_and_freed() -> None:
    blocked = edits.with_cell_blocked(TEAM, Cell(3, 1), blocked=True)
    assert blocked.area.free == (0, 1, 2, 3, 4, 5, 6)
    assert edits.with_cell_blocked(blocked, Cell(3, 1), blocked=False) == TEAM


FULL = msgspec.structs.replace(
    TEAM,
    robots=ROBOTS * 400,
    decisions=DECISIONS * 7,
    rules=tuple(SketchRule(f"R{n}", "same", "x") for n in range(2_001)),
)
REFUSED: dict[str, Callable[[], Sketch]] = {
    "edit.name": lambda: edits.renamed(TEAM, "a b"),
    "edit.name-taken": lambda: edits.with_robot(TEAM, Cell(0, 0), "Ann"),
    "edit.too-many-robots": lambda: edits.with_robot(FULL, Cell(0, 0)),
    "edit.too-many-decisions": lambda: edits.with_decision(FULL, Decision("more", DecisionKind.LEVEL, (1,))),
    "edit.too-many-values": lambda: edits.with_decision(
        TEAM, Decision("more", DecisionKind.LEVEL, tuple(range(4_001)))
    ),
    "edit.too-many-rules": lambda: edits.with_rule(FULL, SketchRule("", "same", "level")),
    "edit.weight": lambda: edits.with_importance(TEAM, "Ann", weight=0),
    "edit.rank": lambda: edits.with_importance(TEAM, "Ann", rank=10**9),
    "edit.cost": lambda: edits.with_rule(TEAM, SketchRule("", "same", "level", cost=limits.MAX_COST + 1)),
    "edit.map": lambda: edits.with_area(TEAM, 0, 4),
    "edit.outside": lambda: edits.with_robot_moved(TEAM, "Ann", Cell(4, 0)),
}


@looped("key", REFUSED)
def test_what_cannot_be_is_told(key: str) -> None:
    with pytest.raises(EditError) as told:
        REFUSED[key]()
    assert told.value.key == key
    assert "{" not in say(key, **told.value.named)


@looped("name", HOSTILE)
def test_a_hostile_name_is_refused_everywhere(name: str) -> None:
    changes: list[Callable[[], Sketch]] = [
        lambda: edits.renamed(TEAM, name),
        lambda: edits.with_robot(TEAM, Cell(0, 0), name),
        lambda: edits.with_robot_renamed(TEAM, "Ann", name),
        lambda: edits.with_decision(TEAM, Decision(name, DecisionKind.LEVEL, (1,))),
    ]
    for change in changes:
        with pytest.raises(EditError):
            change()


def edited(random: Random, sketch: Sketch) -> Sketch:
    """A sketch after some edit."""
    cell = Cell(random.randint(-1, 6), random.randint(-1, 4))
    robot = random.choice(sketch.robots).name if sketch.robots else "nobody"
    decision = random.choice(sketch.decisions) if sketch.decisions else DECISIONS[0]
    rule = random.choice(sketch.rules) if sketch.rules else RULES[0]
    changes: list[Callable[[], Sketch]] = [
        lambda: edits.with_robot(sketch, cell),
        lambda: edits.without_robot(sketch, robot),
        lambda: edits.with_robot_moved(sketch, robot, cell),
        lambda: edits.with_robot_renamed(sketch, robot, random.choice(("Zoe", "x.y", "a"))),
        lambda: edits.with_area(sketch, random.randint(0, 6), random.randint(1, 5)),
        lambda: edits.with_cell_blocked(sketch, cell, blocked=random.random() < 0.7),
        lambda: edits.with_decision(sketch, Decision("more", DecisionKind.SLOT, (1, 2))),
        lambda: edits.with_decision(sketch, msgspec.structs.replace(decision, name="other"), instead_of=decision.name),
        lambda: edits.without_decision(sketch, decision.name),
        lambda: edits.with_rule(sketch, msgspec.structs.replace(rule, id="")) if sketch.rules else sketch,
        lambda: edits.without_rule(sketch, rule.id),
    ]
    try:
        return random.choice(changes)()
    except EditError:
        return sketch


@given(st.integers(0, 10**9))
@examples(60)
def test_no_edit_leaves_what_points_to_nothing(seed: int) -> None:
    random = Random(seed)
    history = History(random_sketch(random))
    first = history.now
    for _ in range(12):
        history = history.edited(edited(random, history.now))
        assert not {trouble.key for trouble in troubles(history.now)} & POINTING
    last = history.now
    while history.before:
        history = history.undone()
    assert history.now == first
    while history.after:
        history = history.redone()
    assert history.now == last


def test_so_many_steps_are_kept() -> None:
    history = History(TEAM)
    for number in range(MAX_STEPS + 10):
        history = history.edited(edits.renamed(TEAM, f"t{number}"))
    assert len(history.before) == MAX_STEPS


def test_an_edit_that_changes_nothing_is_no_step_and_another_one_ends_redoing() -> None:
    history = History(TEAM)
    assert history.edited(TEAM) is history
    assert history.undone() is history.redone() is history
    undone = history.edited(edits.renamed(TEAM, "one")).undone()
    assert undone.edited(edits.renamed(TEAM, "two")).after == ()
