"""What differs between two sketches, said as events: the last epoch is the second sketch, whatever was drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import prod
from random import Random

import msgspec
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robochoc.app.sketch import edits
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.changing_model import FromScratchError, changing_model
from robochoc.app.sketch.checks import troubles
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.texts import say
from robochoc.model.change import apply_changes, describe_change
from robochoc.model.problem import Team
from tests.support.brute_force import priced_solutions
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.sketches import random_sketch, without_costs

LEVEL = Decision("level", DecisionKind.LEVEL, (1, 2, 3))
ROBOTS = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate("ABCD"))


def priced(team: Team) -> dict[frozenset[tuple[str, object]], float]:
    """All solutions of a team in the users' values, with what they cost."""
    words = {name: variable.domain.symbols for name, variable in team.variables.items()}
    return {
        frozenset((name, words[name][value] if words[name] else value) for name, value in solution.items()): cost
        for solution, cost in priced_solutions(team)
    }


def last_epoch(team: Team) -> Team:
    """The team after its events."""
    now = replace(team, scenario=())
    for event in team.scenario:
        now = apply_changes(now, event.changes)
    return now


def varied(random: Random, sketch: Sketch) -> Sketch:
    """The sketch after something has happened to it."""
    for _ in range(random.randint(1, 3)):
        sketch = random.choice(_HAPPENINGS)(random, sketch)
    return sketch


def _leaves(random: Random, sketch: Sketch) -> Sketch:
    return edits.without_robot(sketch, random.choice(sketch.robots).name) if len(sketch.robots) > 1 else sketch


def _joins(random: Random, sketch: Sketch) -> Sketch:
    if len(sketch.robots) > 3:
        return sketch
    return edits.with_robot(sketch, Cell(random.randrange(sketch.area.columns), random.randrange(sketch.area.rows)))


def _other_values(random: Random, sketch: Sketch) -> Sketch:
    decision = random.choice(sketch.decisions)
    values = sketch.values(decision)
    fewer = tuple(random.sample(values, random.randint(1, len(values))))
    return edits.with_decision(sketch, msgspec.structs.replace(decision, values=fewer), instead_of=decision.name)


def _blocks(random: Random, sketch: Sketch) -> Sketch:
    cell = Cell(random.randrange(sketch.area.columns), random.randrange(sketch.area.rows))
    return edits.with_cell_blocked(sketch, cell, blocked=random.random() < 0.7)


def _switches(random: Random, sketch: Sketch) -> Sketch:
    if not sketch.rules:
        return sketch
    rule = random.choice(sketch.rules)
    return edits.with_rule_switched(sketch, rule.id, on=not rule.on)


def _other_rule(random: Random, sketch: Sketch) -> Sketch:
    if not sketch.rules:
        return sketch
    rule = random.choice(sketch.rules)
    return edits.with_rule(sketch, msgspec.structs.replace(rule, cost=random.choice((None, 2))))


def _moves(random: Random, sketch: Sketch) -> Sketch:
    robot = random.choice(sketch.robots)
    cell = Cell(random.randrange(sketch.area.columns), random.randrange(sketch.area.rows))
    return edits.with_robot_moved(sketch, robot.name, cell)


_HAPPENINGS: tuple[Callable[[Random, Sketch], Sketch], ...] = (
    _leaves, _joins, _other_values, _blocks, _switches, _other_rule, _moves,
)  # fmt: skip


def _sound(sketch: Sketch) -> bool:
    return not any(trouble.is_error for trouble in troubles(sketch)) and bool(sketch.robots)


MOST_TRIED = 1_024
"""Assignments of a team whose costs are compared."""


def _assignments(team: Team) -> int:
    return prod(len([*variable.domain]) for variable in team.variables.values())


@given(st.integers(0, 10**9))
@examples(40)
def test_the_last_epoch_is_the_second_sketch(seed: int) -> None:
    random = Random(seed)
    before = without_costs(random_sketch(random))
    after = without_costs(varied(random, before))
    assume(_sound(before) and _sound(after))
    team, why = _team_or_why(before, after)
    if team is None:
        assert why
        assert why != "whatif.anew-other"
        return
    first, last = model_of(before).team, model_of(after).team
    assume(max(map(_assignments, (first, last))) <= MOST_TRIED)
    assert priced(replace(team, scenario=())) == priced(first)
    assert priced(last_epoch(team)) == priced(last)


def _team_or_why(before: Sketch, after: Sketch) -> tuple[Team | None, str]:
    try:
        return changing_model(before, after).team, ""
    except FromScratchError as anew:
        return None, anew.key


def _sketch(*rules: SketchRule) -> Sketch:
    return Sketch("team", Area(4, 1), ROBOTS, (LEVEL,), rules)


def _told(before: Sketch, after: Sketch) -> list[str]:
    """What happens between two sketches, as commands tell it."""
    team = changing_model(before, after).team
    (event,) = team.scenario
    return [describe_change(change, team) for change in event.changes]


def test_a_robot_fails_and_a_rule_of_all_goes_on_without_it() -> None:
    before = _sketch(SketchRule("R1", "at-most", "level", (), {"value": 1, "count": 2}))
    assert _told(before, edits.without_robot(before, "B")) == ["-B"]


def test_a_rule_of_one_robot_is_said_by_its_values() -> None:
    only = SketchRule("R1", "only", "level", ("A",), {"values": [1, 2]})
    assert _told(_sketch(), _sketch(only)) == ["A.level without 3"]
    assert _told(_sketch(only), _sketch()) == ["A.level with 3"]


def test_the_same_rule_under_another_name_changes_nothing() -> None:
    apart, again = (SketchRule(name, "apart", "level", (), {"gap": 1}) for name in ("R1", "R7"))
    assert _told(_sketch(apart), _sketch(again)) == []


def test_names_that_run_together_are_kept_apart() -> None:
    robots = tuple(SketchRobot(name, Cell(0, 0)) for name in ("a", "b.c", "a.b", "c"))
    rules = (SketchRule("R1", "different", "level", ("a", "b.c")), SketchRule("R1", "different", "level", ("a.b", "c")))
    before = Sketch("team", Area(1, 1), robots, (LEVEL,), rules)
    after = Sketch("team", Area(1, 1), robots, (LEVEL,), rules[1:])
    assert priced(last_epoch(changing_model(before, after).team)) == priced(model_of(after).team)


def _with(**changes: object) -> Sketch:
    return msgspec.structs.replace(_sketch(), **changes)


@looped(
    ("after", "key"),
    [
        (_with(robots=(SketchRobot("Z", Cell(0, 0)),)), "nobody"),
        (_with(area=Area(5, 1)), "map"),
        (_with(decisions=(LEVEL, Decision("slot", DecisionKind.SLOT, (1, 2)))), "decision"),
        (_with(decisions=(Decision("level", DecisionKind.SLOT, (1, 2)),)), "decision"),
        (_with(robots=(*ROBOTS[:3], SketchRobot("D", Cell(3, 0), 7))), "importance"),
        (_with(robots=(*ROBOTS[:3], SketchRobot("D", Cell(0, 0)))), "moved"),
        (_sketch(SketchRule("R1", "little", "level", ("A",), {"step": 1})), "wish"),
        (_sketch(SketchRule("R1", "prefers", "level", ("A",), {"value": 1}, 3)), "wish"),
        (_sketch(SketchRule("R1", "different", "level", ("A", "B"), private=True)), "private"),
    ],
)
def test_what_cannot_be_said_is_told(after: Sketch, key: str) -> None:
    with pytest.raises(FromScratchError) as told:
        changing_model(_sketch(), after)
    assert told.value.key == f"whatif.anew-{key}"
    assert "{" not in say(told.value.key, **told.value.named)


def test_a_robot_that_joins_brings_its_wishes() -> None:
    before = _sketch(SketchRule("R1", "little", "level", (), {"step": 2}))
    after = edits.with_robot(before, Cell(3, 0), "E")
    now = last_epoch(changing_model(before, after).team)
    assert priced(now) == priced(model_of(after).team)
