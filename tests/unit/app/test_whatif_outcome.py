"""What a change comes to, from the results of real runs of the team that changes."""

from __future__ import annotations

import msgspec

from robochoc.app.pages.whatif.outcome import Fate, compare, part_of, parts_of_epochs
from robochoc.app.runs.result import RunResult
from robochoc.app.sketch.changing_model import changing_model
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.sketch.team_changes import AnyTeamChange, CellBlocked, LowBattery, RobotFails, RobotJoins, changed
from robochoc.model.outcome import Verdict
from tests.support.run_results import run_epoch, run_result

ROBOTS = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate("ABC"))
TASK = Decision("task", DecisionKind.TASK, ("two words", "wash", "dry"))
TEAM = Sketch("team", Area(3, 1), ROBOTS, (TASK,), (SketchRule("R1", "different", "task"),))


def result(*epochs: tuple[str, dict[str, int | str], int], protocol: str = "dynabt") -> RunResult:
    given = [run_epoch(verdict, assignment, messages=messages) for verdict, assignment, messages in epochs]
    return run_result(epochs[-1][0], epochs[-1][1], protocol=protocol, epochs=given)


def test_robots_stay_move_leave_and_come() -> None:
    after = changed(TEAM, [RobotFails("A"), RobotJoins(Cell(0, 0), "D")])
    said = result(
        ("solution", {"A.task": "two_words", "B.task": "wash", "C.task": "dry"}, 9),
        ("solution", {"B.task": "wash", "C.task": "two_words", "D.task": "dry"}, 4),
    )
    parts = parts_of_epochs(TEAM, after, changing_model(TEAM, after), said)
    assert parts is not None
    found = compare((TEAM, parts[0]), (after, parts[1]), said.protocol)
    assert [(row.robot, row.before, row.after, row.fate) for row in found.rows] == [
        ("A", "two words", "", Fate.LEFT),
        ("B", "wash", "wash", Fate.SAME),
        ("C", "dry", "two words", Fate.MOVED),
        ("D", "", "dry", Fate.NEW),
    ]
    assert (found.moved, found.stayed, found.before.messages, found.after.messages) == (["C"], 2, 9, 4)


def test_without_a_solution_nobody_has_moved() -> None:
    parts = parts_of_epochs(
        TEAM, TEAM, changing_model(TEAM, TEAM), result(("solution", {"A.task": "wash"}, 1), ("no-solution", {}, 2))
    )
    assert parts is not None
    found = compare((TEAM, parts[0]), (TEAM, parts[1]), "dynabt")
    assert {row.fate for row in found.rows} == {Fate.OPEN}
    assert (found.before.solved, found.after.solved, found.moved) == (True, False, [])


def test_a_run_that_did_not_come_to_the_change_has_no_outcome() -> None:
    assert parts_of_epochs(TEAM, TEAM, changing_model(TEAM, TEAM), result(("unknown", {}, 0))) is None


def test_a_team_alone_is_told_by_its_result() -> None:
    part = part_of(TEAM, None, run_result(Verdict.SOLUTION, {"B.task": "two_words"}, cost=3))
    assert (part.values, part.cost, part.solved) == ({("B", "task"): "two words"}, 3, True)


def test_what_has_happened_is_kept_on_disk() -> None:
    changes: tuple[AnyTeamChange, ...] = (
        RobotFails("A"),
        CellBlocked(Cell(1, 0)),
        LowBattery("B", 40),
        RobotJoins(Cell(0, 0)),
    )
    assert msgspec.json.decode(msgspec.json.encode(changes), type=tuple[AnyTeamChange, ...]) == changes
