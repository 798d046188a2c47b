"""What is pure of the page "Model": values as they are typed, what is drawn, and what a click means."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import TYPE_CHECKING, cast

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.app.sketch.checks import troubles
from robochoc.app.sketch.edits import EditError, with_rule, without_decision
from robochoc.app.sketch.rule_checks import why_no_cost, why_not_private
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import (
    MAX_VALUES,
    Area,
    Cell,
    Decision,
    DecisionKind,
    Sketch,
    SketchRobot,
    SketchRule,
    Value,
)
from robochoc.app.sketch.troubles import About
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.sketches import random_sketch

pytest.importorskip("nicegui")

from robochoc.app.pages.model import picture
from robochoc.app.pages.model.desk import Desk
from robochoc.app.pages.model.page import with_cell_clicked, with_robot_clicked
from robochoc.app.pages.model.rule_form import filled
from robochoc.app.pages.model.rules_panel import first_rule
from robochoc.app.pages.model.values import (
    first_values,
    free_decision_name,
    typed_values,
    with_cell,
    written_values,
)

if TYPE_CHECKING:
    from robochoc.app.projects import Project

LEVEL, PLACE = Decision("level", DecisionKind.LEVEL, (1, 2, 3)), Decision("place", DecisionKind.PLACE)
ROBOTS = tuple(SketchRobot(name, Cell(x, 0)) for x, name in enumerate(("North", "South", "East")))
TEAM = Sketch("team", Area(4, 3), ROBOTS, (LEVEL, PLACE))


@dataclass
class Held:
    """What of a project a desk asks for."""

    sketch: Sketch


@looped(
    ("text", "values"),
    [
        ("1-5", (1, 2, 3, 4, 5)),
        ("1 to 3, 7", (1, 2, 3, 7)),
        ("-3..-1", (-3, -2, -1)),
        ("-2-1", (-2, -1, 0, 1)),
        ("5\N{EN DASH}3", (3, 4, 5)),
        ("2, 1; 2\n3", (2, 1, 3)),
        ("", ()),
    ],
)
def test_numbers_are_read_as_they_are_typed(text: str, values: tuple[int, ...]) -> None:
    assert typed_values(DecisionKind.LEVEL, text) == values


@looped("text", ["a", "1-", "1.5", "1-2-3", "\u0663", "9" * 30, "0-999999999", "1000001", "<b>"])
def test_what_is_no_number_is_told(text: str) -> None:
    with pytest.raises(EditError):
        typed_values(DecisionKind.SLOT, text)


def test_so_many_values_and_no_more() -> None:
    assert len(typed_values(DecisionKind.LEVEL, f"1-{MAX_VALUES}")) == MAX_VALUES
    with pytest.raises(EditError):
        typed_values(DecisionKind.LEVEL, f"1-{MAX_VALUES}, 0")


def test_names_stay_as_they_are_typed() -> None:
    assert typed_values(DecisionKind.TASK, " wash, <b>dry</b>, wash,, 1-5 ") == ("wash", "<b>dry</b>", "1-5")
    for text in ("x" * 61, "a\x00b", "a\u202eb"):
        with pytest.raises(EditError):
            typed_values(DecisionKind.TASK, text)


@given(st.lists(st.integers(-1000, 1000), unique=True))
@examples(100)
def test_numbers_that_are_written_are_read_again(values: list[int]) -> None:
    assert typed_values(DecisionKind.LEVEL, written_values(tuple(values))) == tuple(values)


def test_ranges_are_written_as_such() -> None:
    assert written_values((1, 2, 3, 7, 8, 10)) == "1-3, 7, 8, 10"
    assert written_values(("wash", "dry")) == "wash, dry"


def test_a_decision_begins_with_something_to_choose_from() -> None:
    for kind in DecisionKind:
        sketch = Sketch(robots=ROBOTS, decisions=(Decision("it", kind, first_values(TEAM, kind, "one, two")),))
        assert troubles(sketch) == []
    assert free_decision_name(TEAM, "slot") == "slot"
    assert free_decision_name(TEAM, "level") == "level2"


def test_cells_are_clicked_together_and_all_of_them_are_none_by_name() -> None:
    one_less = with_cell_clicked(TEAM, Cell(0, 0), "place", None)
    assert one_less.decisions[1].values == tuple(range(1, 12))
    assert with_cell_clicked(one_less, Cell(0, 0), "place", None) == TEAM
    assert with_cell(TEAM, PLACE, 11) == tuple(range(11))


def test_cells_are_those_of_the_named_place_alone() -> None:
    without = without_decision(TEAM, "level")
    assert with_cell_clicked(without, Cell(0, 0), "place", None).decisions[0].values == tuple(range(1, 12))
    for name in ("level", "gone"):
        assert with_cell_clicked(TEAM, Cell(0, 0), name, None) == TEAM


def test_the_last_cell_and_the_last_robot_stay() -> None:
    one = msgspec.structs.replace(TEAM, decisions=(Decision("place", DecisionKind.PLACE, (0,)),))
    with pytest.raises(EditError, match=r"edit\.last-cell"):
        with_cell_clicked(one, Cell(0, 0), "place", None)
    named = with_rule(TEAM, SketchRule("", "different", "level", ("North",)))
    with pytest.raises(EditError, match=r"edit\.last-of-rule"):
        with_robot_clicked(named, named.rules[0], "North")


def test_a_robot_that_was_just_added_is_named_but_rules_are_not_for_it() -> None:
    desk = Desk(cast("Project", Held(TEAM)))
    desk.select_added("South")
    assert (desk.selected, desk.rule_robots) == (["South"], [])
    desk.select(["South"])
    assert desk.rule_robots == ["South"]


def test_a_place_whose_cells_are_clicked_is_let_go_when_it_is_gone() -> None:
    desk = Desk(cast("Project", Held(TEAM)), cells_of="place")
    desk.drop_removed()
    assert desk.cells_of == "place"
    desk.project = cast("Project", Held(without_decision(TEAM, "place")))
    desk.drop_removed()
    assert desk.cells_of is None


def test_each_element_has_its_own_troubles() -> None:
    blocked = Sketch("t", Area(4, 3, frozenset({Cell(0, 0), Cell(1, 0)})), ROBOTS, (LEVEL,))
    desk = Desk(cast("Project", Held(blocked)))
    desk.troubles = troubles(blocked)
    found = {name: [one.element for one in desk.troubles_at(About.ROBOT, name)] for name in ("North", "South", "East")}
    assert found == {"North": ["North"], "South": ["South"], "East": []}
    assert desk.troubles_at(About.RULE, "North") == []


def test_pairs_are_filled_as_a_rectangle_and_emptied_again() -> None:
    rows: list[list[Value]] = [[1, 1], [9]]
    more = filled(rows, (1, 2), (1, 3), on=True)
    assert more == [[1, 1], [9], [1, 3], [2, 1], [2, 3]]
    assert filled(more, (1, 2), (1,), on=False) == [[9], [1, 3], [2, 3]]


@looped(
    ("rules", "private_off", "costs_off"),
    [
        ((), False, False),
        ((SketchRule("R1", "prefers", "level", (), {"value": 1}, 3),), True, False),
        ((SketchRule("R1", "little", "level", (), {"step": 1}),), True, False),
        ((SketchRule("R1", "little", "level", (), {"step": 1}, on=False),), False, False),
        ((SketchRule("R1", "apart", "level", ("North", "South"), {"gap": 1}, private=True),), False, True),
        ((SketchRule("R1", "never", "level", (), {"value": 1}, private=True),), False, False),
    ],
)
def test_secrets_and_costs_are_told_apart_before_they_meet(
    rules: tuple[SketchRule, ...],
    private_off: bool,  # noqa: FBT001 - a parameter
    costs_off: bool,  # noqa: FBT001 - a parameter
) -> None:
    new = SketchRule("R9", "close", "level", ("North", "East"), {"gap": 1})
    sketch = msgspec.structs.replace(TEAM, rules=(*rules, new))
    assert (why_not_private(sketch, new) is not None) is private_off
    assert (why_no_cost(sketch, new) is not None) is costs_off
    private = with_rule(sketch, msgspec.structs.replace(new, private=True))
    costs = with_rule(sketch, msgspec.structs.replace(new, cost=1))
    for made, off in ((private, private_off), (costs, costs_off)):
        assert any(one.key == "trouble.rule-private-cost" for one in troubles(made)) is off


def test_a_rule_of_one_robot_may_always_be_private_and_a_group_never() -> None:
    little = SketchRule("R1", "little", "level", (), {"step": 1})
    group = SketchRule("R2", "at-most", "level", (), {"value": 1, "count": 1})
    sketch = msgspec.structs.replace(TEAM, rules=(little, group))
    assert why_not_private(sketch, little) is None
    found = why_not_private(sketch, group)
    assert found is not None
    assert found.key == "trouble.rule-private-many"


@given(st.integers(0, 2**32))
@examples(60)
def test_a_rule_that_is_picked_begins_without_an_error(seed: int) -> None:
    sketch = random_sketch(Random(seed))
    for decision in sketch.decisions:
        for entry in PALETTE.values():
            if decision.kind in entry.kinds and len(sketch.deciders(decision)) >= entry.fewest:
                rule = first_rule(sketch, entry, decision, [robot.name for robot in sketch.robots[:1]])
                added = with_rule(Sketch(sketch.name, sketch.area, sketch.robots, sketch.decisions), rule)
                wrong = {trouble.key for trouble in troubles(added) if trouble.is_error and trouble.element == "R1"}
                assert wrong <= {"trouble.rule-table-none", "trouble.rule-value", "trouble.rule-values-none"}
                assert sketch.values(decision) == () or wrong <= {"trouble.rule-table-none"}


def test_a_rule_is_for_whom_is_selected() -> None:
    apart, leader = PALETTE["apart"], PALETTE["leader-above"]
    assert first_rule(TEAM, apart, LEVEL, ["South", "North"]).robots == ("South", "North")
    assert first_rule(TEAM, leader, LEVEL, ["East"]).robots == ()
    assert first_rule(TEAM, PALETTE["table"], LEVEL, []).robots == ("North", "South")
    assert first_rule(TEAM, PALETTE["prefers"], LEVEL, ["East"]).cost == 1
    some = Decision("place", DecisionKind.PLACE, (0, 6, 8))
    assert first_rule(TEAM, PALETTE["rather"], some, ["East"]).settings == {"value": 6, "step": 1}


def test_a_robot_that_is_clicked_goes_into_the_open_rule_and_out_of_it() -> None:
    sketch = with_rule(TEAM, SketchRule("", "different", "level", ("North",)))
    for name, robots in (("East", ("North", "East")), ("North", ("East",)), ("North", ("East", "North"))):
        sketch = with_robot_clicked(sketch, sketch.rules[0], name)
        assert sketch.rules[0].robots == robots


def test_a_cell_that_is_clicked_fills_the_opening_of_a_rule() -> None:
    never = with_rule(TEAM, SketchRule("", "never", "place", (), {"value": 0}))
    assert with_cell_clicked(never, Cell(1, 1), None, "R1").rules[0].settings == {"value": 5}
    only = with_rule(TEAM, SketchRule("", "only", "place", (), {"values": [0]}))
    two = with_cell_clicked(only, Cell(1, 1), None, "R1")
    assert two.rules[0].settings == {"values": [0, 5]}
    assert with_cell_clicked(two, Cell(1, 1), None, "R1") == only
    level = with_rule(TEAM, SketchRule("", "never", "level", (), {"value": 1}))
    assert with_cell_clicked(level, Cell(1, 1), None, "R1") == level


@given(st.integers(0, 2**32))
@examples(60)
def test_what_is_drawn_is_whom_rules_link(seed: int) -> None:
    sketch = random_sketch(Random(seed))
    names = [robot.name for robot in sketch.robots]
    drawn = {link["rule"]: [names[index] for index in link["of"]] for link in picture.links_of(sketch).drawn}
    for rule in sketch.rules:
        groups = PALETTE[rule.kind].groups(sketch, rule) if rule.on else ()
        assert drawn.get(rule.id, []) == [name for group in groups for name in group]


def test_rules_with_too_many_links_are_left_out_and_said() -> None:
    many = tuple(SketchRobot(f"R{number}", Cell(0, 0)) for number in range(picture.MOST_NEIGHBOURS))
    near = SketchRule("R1", "neighbours-different", "level", (), {"radius": 1})
    rules = (near, SketchRule("R2", "at-most", "level"))
    found = picture.links_of(Sketch(robots=many, decisions=(LEVEL,), rules=rules))
    assert found.left_out == {"R1"}
    assert [link["rule"] for link in found.drawn] == ["R2"]


def test_many_pairs_are_drawn_as_what_is_around_them() -> None:
    rules = (SketchRule("R1", "different", "level"),)
    for count, shape, ends in ((25, "lines", 600), (26, "hull", 26)):
        robots = tuple(SketchRobot(f"R{number}", Cell(0, 0)) for number in range(count))
        (link,) = picture.links_of(Sketch(robots=robots, decisions=(LEVEL,), rules=rules)).drawn
        assert (link["shape"], len(link["of"])) == (shape, ends)


def test_rules_that_may_be_broken_are_drawn_softly() -> None:
    soft = {}
    for kind, cost in (("different", None), ("different", 5), ("little", None)):
        rule = SketchRule("R1", kind, "level", cost=cost)
        (link,) = picture.links_of(Sketch(robots=ROBOTS, decisions=(LEVEL,), rules=(rule,))).drawn
        soft[kind, cost] = link["soft"]
    assert soft == {("different", None): False, ("different", 5): True, ("little", None): True}


def test_marks_say_who_matters_and_who_is_above() -> None:
    assert picture.mark_of(SketchRobot("a", Cell(0, 0))) == ""
    assert picture.mark_of(SketchRobot("a", Cell(0, 0), 3, -2)) == "\N{MULTIPLICATION SIGN}3 \u25bc2"
    blocked = Sketch("t", Area(4, 3, frozenset({Cell(0, 0)})), ROBOTS, (LEVEL,))
    drawn = picture.robots_of(blocked, troubles(blocked))
    assert [robot["trouble"] for robot in drawn] == [True, False, False]
    assert "blocked cell" in drawn[0]["says"]
