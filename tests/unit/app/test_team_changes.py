"""What may happen to a team: each change as a sketch, and in words."""

from __future__ import annotations

import pytest

from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.sketch.team_changes import (
    CellBlocked,
    LowBattery,
    RobotFails,
    RobotJoins,
    TeamChange,
    changed,
    sentences_of,
)
from tests.support.cases import looped

LEVEL = Decision("level", DecisionKind.LEVEL, (1, 2, 3, 4))
PLACE = Decision("place", DecisionKind.PLACE, (0, 1, 2))
ROBOTS = (SketchRobot("A", Cell(0, 0)), SketchRobot("B", Cell(1, 0)))
TEAM = Sketch("team", Area(3, 1), ROBOTS, (LEVEL,))


def test_a_robot_fails() -> None:
    assert [robot.name for robot in changed(TEAM, [RobotFails("A")]).robots] == ["B"]
    assert sentences_of(TEAM, [RobotFails("A")]) == ["A fails."]


@pytest.mark.parametrize("change", [RobotFails("A"), LowBattery("A", 50)])
def test_nothing_happens_to_a_robot_that_is_gone(change: TeamChange) -> None:
    with pytest.raises(EditError) as error:
        changed(TEAM, [RobotFails("A"), change])
    assert error.value.key == "whatif.gone"


def test_a_battery_limits_levels() -> None:
    after = changed(TEAM, [LowBattery("A", 50)])
    assert after.rules == (SketchRule("R1", "only", "level", ("A",), {"values": [1, 2]}),)
    assert "level 2, and no higher" in sentences_of(TEAM, [LowBattery("A", 50)])[0]


@looped(("percent", "words", "left"), [(100, "every level", 2), (19, "leaves", 1), (20, "leaves", 1)])
def test_a_battery_that_is_full_or_empty(percent: int, words: str, left: int) -> None:
    """With a fifth of four levels there is none left: the robot leaves as below the limit."""
    assert words in sentences_of(TEAM, [LowBattery("A", percent)])[0]
    after = changed(TEAM, [LowBattery("A", percent)])
    assert (len(after.robots), after.rules) == (left, ())


def test_a_blocked_cell_is_no_place_even_where_places_are_listed() -> None:
    places = Sketch("team", Area(3, 1), ROBOTS, (PLACE,))
    assert changed(places, [CellBlocked(Cell(1, 0))]).decisions[0].values == (0, 2)
    assert sentences_of(places, [CellBlocked(Cell(1, 0))]) == ["The cell in column 2, row 1 is blocked."]
    assert "changes nothing" in sentences_of(TEAM, [CellBlocked(Cell(1, 0))])[0]


def test_the_last_listed_place_cannot_be_blocked() -> None:
    """No values at all would mean every free cell."""
    one = Sketch("team", Area(3, 1), ROBOTS, (Decision("place", DecisionKind.PLACE, (1,)),))
    with pytest.raises(EditError) as error:
        changed(one, [CellBlocked(Cell(1, 0))])
    assert error.value.key == "whatif.last-place"


def test_a_robot_joins_also_where_deciders_are_listed() -> None:
    listed = Sketch("team", Area(3, 1), ROBOTS, (Decision("level", DecisionKind.LEVEL, (1, 2), ("A", "B")),))
    after = changed(listed, [RobotJoins(Cell(2, 0), "C")])
    assert after.decisions[0].robots == ("A", "B", "C")
    assert sentences_of(listed, [RobotJoins(Cell(2, 0), "C")]) == ["C joins in column 3, row 1."]


def test_a_robot_joins_in_no_blocked_cell() -> None:
    with pytest.raises(EditError) as error:
        changed(TEAM, [CellBlocked(Cell(2, 0)), RobotJoins(Cell(2, 0))])
    assert error.value.key == "whatif.blocked-cell"


def test_a_battery_says_nothing_of_levels_where_nobody_decides_them() -> None:
    places = Sketch("team", Area(3, 1), ROBOTS, (PLACE,))
    assert sentences_of(places, [LowBattery("A", 50)]) == ["A has 50 % of its battery left: enough to stay."]
