"""Whether a team goes on from before is told before it decides again, and it is true."""

from __future__ import annotations

import msgspec
import pytest

pytest.importorskip("nicegui")

from robochoc.app.pages.whatif.can_continue import why_not_continue
from robochoc.app.pages.whatif.story import is_dynamic
from robochoc.app.sketch.changes import AnyChange, Battery, Blocked, Fails, Joins, changed
from robochoc.app.sketch.differences import changing_model
from robochoc.app.sketch.examples import example
from robochoc.app.sketch.sketch import Cell, Sketch
from tests.support.cases import looped


@looped(
    ("key", "change", "says"),
    [
        ("channels", Fails("Radio1"), ""),
        ("coverage", Fails("Eye1"), ""),
        ("hangar", Joins(Cell(0, 0)), "This team is quicker when it decides anew"),
        ("charging", Fails("Ada"), "Some rules of this team cost something"),
        ("secrets", Fails("Press"), "This team has private rules"),
    ],
)
def test_what_is_told_before_comes_true(key: str, change: AnyChange, says: str) -> None:
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
    assert why_not_continue(before, after) == "The team decides anew: Radio1 counts, or ranks, differently."


@pytest.mark.parametrize("change", [Blocked(Cell(0, 0)), Battery("Eye1", 50)])
def test_a_team_with_a_mistake_is_left_to_its_own_words(change: AnyChange) -> None:
    before = msgspec.structs.replace(example("coverage"), decisions=())
    assert why_not_continue(before, changed(before, (change,))) == ""
    assert why_not_continue(Sketch("empty"), Sketch("empty")) == ""
