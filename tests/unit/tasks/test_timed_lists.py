"""Lists with windows, durations and precedence: the optimum of all allocations, orders and starts."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.run import Options, Runtime, solve
from tests.support.random_task_lists import read_or_refused, written
from tests.support.task_lists import imported, mistakes
from tests.support.timed_task_lists import TimedMeaning, timed_list

LIST = """tours: yes
robots:
  ann: {at: [0, 0], skills: arm, most: 3}
  bob: {at: [9, 0], skills: eye}
tasks:
  unlock: {at: [4, 0], needs: eye, worth: 20, window: [0, 12], duration: 2}
  carry: {at: [4, 3], needs: arm, worth: 20, after: unlock, window: [2, 12], duration: 1}
  look: {at: [0, 3], needs: arm, worth: 9, window: [10, 20]}
"""


@pytest.mark.usefixtures("shared_solvers")
@pytest.mark.parametrize("count", [40, pytest.param(500, marks=pytest.mark.slow)])
def test_random_lists_with_times_have_the_optimum_of_all_orders(count: int, tmp_path: Path) -> None:
    chance, solved, ordered = Random(f"times {count}"), 0, 0
    while solved < count:
        told = timed_list(chance)
        meaning = TimedMeaning(told)
        path = tmp_path / "list.yaml"
        path.write_text(written(told, "block"))
        team, error = read_or_refused(path)
        if team is None:
            assert "can do any" in error or "a different number" in error or "divided" in error, (
                error + path.read_text()
            )
            continue
        best = meaning.best()
        found = solve(team, Options(protocol=("sfb", "dpop")[solved % 2], runtime=Runtime.SIMULATOR)).cost
        assert found is not None
        assert Fraction(found) == best, path.read_text()
        solved += 1
        ordered += bool(meaning.ordered)
    assert ordered > count / 3


def test_a_task_begins_after_another_robot_has_ended_one(tmp_path: Path) -> None:
    team = imported(LIST, tmp_path).team
    outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert outcome.cost == 20 + 20 + 9 - 5 - (5 + 4)
    rows = outcome_report(team, outcome).splitlines()
    assert rows[1:4] == ["    robot  does", "    ann    carry (starts at 7), look", "    bob    unlock (starts at 5)"]
    late = LIST.replace("window: [2, 12]", "window: [2, 6]")
    assert solve(imported(late, tmp_path).team, Options(protocol="dpop", runtime=Runtime.SIMULATOR)).cost == 20 + 9 - 8


def test_a_task_after_one_that_nobody_can_do_is_left_out(tmp_path: Path) -> None:
    notes = imported(LIST.replace("skills: eye", "skills: ear"), tmp_path).notes
    assert [note.text for note in notes if note.kind == "left out"] == [
        "the robot bob, which can do none of the tasks",
        "the task unlock, which no robot can do",
        "the task carry, which no robot can do",
    ]


@pytest.mark.parametrize(
    ("now", "then", "told"),
    [
        (
            "after: unlock",
            "after: unlck",
            "7: the task 'carry' is after 'unlck', which is not in the list (did",
        ),
        ("after: unlock", "after: carry", "7: the order of tasks is a cycle: carry, carry (delete one after:)"),
        ("window: [2, 12], ", "", "7: the task 'carry' precedes or follows another task, and has no window (write"),
        ("[2, 12]", "[12, 2]", "7: the task 'carry' has a window whose end is before its beginning"),
        ("[2, 12]", "[2]", "7: the task 'carry' cannot have this value as 'window' (write window: [EARLIEST, LATEST])"),
        (
            "tours: yes",
            "tours: no",
            "6: the task 'unlock' has duration:, but robots that do several tasks have no",
        ),
        ("tours: yes", "model: assignment", "has after:, which the model assignment does not support"),
        ("tours: yes", "tours: yes\nstep: 0", "2: the list has the step 0 (write a number above 0)"),
        ("tours: yes", "tours: yes\nstep: 0.001", "the task 'unlock' has 12,001 starts in its window; at most 1,000"),
        (
            "tours: yes",
            "tours: yes\nstep: 13",
            "8: the task 'carry' precedes or follows another task, and its window has no multiple of step: 13",
        ),
    ],
)
def test_mistakes_in_times_have_their_line(now: str, then: str, told: str, tmp_path: Path) -> None:
    assert told in mistakes(LIST.replace(now, then), tmp_path)
