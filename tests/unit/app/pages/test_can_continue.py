"""Whether a team goes on from before is told before it decides again, and it is true."""

from __future__ import annotations

import msgspec
import pytest

pytest.importorskip("nicegui")

from robochoc.app.pages.whatif.story import is_dynamic, why_not_continue
from robochoc.app.sketch.changing_model import changing_model
from robochoc.app.sketch.example_sketches import example
from robochoc.app.sketch.sketch import Cell, Sketch
from robochoc.app.sketch.team_changes import AnyTeamChange, CellBlocked, LowBattery, RobotFails, RobotJoins, changed
from tests.support.cases import looped


@looped(
    ("key", "change", "says"),
    [
        ("channels", RobotFails("Radio1"), ""),
        ("coverage", RobotFails("Eye1"), ""),
        ("hangar", RobotJoins(Cell(0, 0)), ""),
        ("cube", RobotFails("D11"), "This team decides from scratch after a change"),
        ("charging", RobotFails("Ada"), "This team has rules with costs"),
        ("secrets", RobotFails("Press"), "This team has private rules"),
    ],
)
def test_what_is_told_before_comes_true(key: str, change: AnyTeamChange, says: str) -> None:
    before = example(key)
    after = changed(before, (change,))
    told = why_not_continue(before, after)
    assert told.startswith(says)
    assert bool(told) is bool(says)
    solution = changing_model(before, after).solve(runtime="simulator")
    assert is_dynamic(solution.protocol) is not bool(told)


def test_what_no_event_can_say_is_told_before() -> None:
    before = example("channels")
    moved = msgspec.structs.replace(before.robots[0], weight=7)
    after = msgspec.structs.replace(before, robots=(moved, *before.robots[1:]))
    assert why_not_continue(before, after) == "The team decides from scratch: Radio1 has another weight or rank."


@pytest.mark.parametrize("change", [CellBlocked(Cell(0, 0)), LowBattery("Eye1", 50)])
def test_a_team_with_a_mistake_is_left_to_its_own_words(change: AnyTeamChange) -> None:
    before = msgspec.structs.replace(example("coverage"), decisions=())
    assert why_not_continue(before, changed(before, (change,))) == ""
    assert why_not_continue(Sketch("empty"), Sketch("empty")) == ""
