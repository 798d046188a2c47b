"""Lists whose tasks need teams: several robots with given skills, at the same time."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robochoc.cli.reports.outcome import outcome_report
from robochoc.model.change import apply_changes
from robochoc.model.coalition import can_fill, coalitions
from robochoc.model.problem import RemoveAgent
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.solver.errors import UnsupportedError
from tests.support.random_task_lists import read_or_refused, written
from tests.support.task_lists import imported, mistakes
from tests.support.timed_task_lists import TimedMeaning, team_list

LIST = """tours: yes
distance: streets
robots:
  ann: {at: [0, 0], skills: [camera, gripper]}
  bob: {at: [9, 0], skills: gripper}
  cid: {at: [5, 9], skills: [gripper]}
tasks:
  lift: {at: [5, 5], team: {camera: 1, gripper: 1}, worth: 60, window: [0, 20], duration: 3}
  look: {at: [1, 0], needs: camera, worth: 12, window: [12, 30]}
"""
_OPTIONS = Options(protocol="sfb", runtime=Runtime.SIMULATOR)
_SKILLS = ("arm", "eye", "leg")


@pytest.mark.usefixtures("shared_solvers")
@pytest.mark.parametrize("count", [40, pytest.param(500, marks=pytest.mark.slow)])
def test_random_lists_with_teams_have_the_optimum_of_all_coalitions(count: int, tmp_path: Path) -> None:
    chance, solved, joint = Random(f"teams {count}"), 0, 0
    while solved < count:
        told = team_list(chance)
        meaning = TimedMeaning(told)
        path = tmp_path / "list.yaml"
        path.write_text(written(told, "block"))
        team, error = read_or_refused(path)
        if team is None:
            expected = ("can do any", "which no robot has", "a different number", "divided", "no tours")
            assert any(one in error for one in expected), error + path.read_text()
            continue
        best = meaning.best()
        found = solve(team, Options(protocol=("sfb", "dpop")[solved % 2], runtime=Runtime.SIMULATOR))
        assert found.cost is not None
        assert Fraction(found.cost) == best, path.read_text()
        solved += 1
        joint += any(
            sum(found.assignment.get(f"{one}.{task}", 0) for one in told["robots"]) > 1 for task in told["tasks"]
        )
    assert joint > count / 5


@pytest.mark.usefixtures("shared_solvers")
@pytest.mark.parametrize("count", [15, pytest.param(500, marks=pytest.mark.slow)])
def test_if_a_robot_leaves_the_others_have_the_optimum_of_their_own_coalitions(count: int, tmp_path: Path) -> None:
    """Withdrawals are refused: a robot that withdraws would lose its worth, which is a negative cost.

    The rule that an earlier task must be done is dropped with the robot, so there are no orders here.
    """
    chance, solved = Random(f"losses {count}"), 0
    while solved < count:
        told = team_list(chance)
        for task in told["tasks"].values():
            task.pop("after", None)
        path = tmp_path / "list.yaml"
        path.write_text(written(told, "block"))
        team, _ = read_or_refused(path)
        if team is None or len(team.order) < 2:
            continue
        with pytest.raises(UnsupportedError, match="negative costs, or utilities; with --withdraw"):
            solve(team, Options(protocol="sfb", runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MINIMUM))
        gone = chance.choice(team.order)
        rest = {**told, "robots": {name: one for name, one in told["robots"].items() if name != gone}}
        found = solve(apply_changes(team, [RemoveAgent(gone)]), _OPTIONS)
        assert found.cost is not None
        assert Fraction(found.cost) == TimedMeaning(rest).best(), (gone, path.read_text())
        solved += 1


@pytest.mark.usefixtures("shared_solvers")
def test_a_team_starts_at_the_same_time_and_fills_all_places(tmp_path: Path) -> None:
    team = imported(LIST, tmp_path).team
    outcome = solve(team, _OPTIONS)
    assert outcome.cost == (60 - 10 - 4) + (12 - 9)
    rows = outcome_report(team, outcome).splitlines()
    assert rows[2:5] == ["    ann    lift (starts at 10), look", "    bob    -", "    cid    lift (starts at 10)"]


@pytest.mark.usefixtures("shared_solvers")
def test_a_robot_with_two_skills_has_one_place(tmp_path: Path) -> None:
    alone = LIST.replace("{camera: 1, gripper: 1}", "{camera: 1, gripper: 3}")
    result = imported(alone, tmp_path)
    assert [one.text for one in result.notes if "lift" in one.text] == [
        "the task lift, which no team of these robots can do"
    ]
    three = LIST.replace("{camera: 1, gripper: 1}", "3")
    assert solve(imported(three, tmp_path).team, _OPTIONS).cost == (60 - 10 - 9 - 4) + (12 - 9)


@settings(max_examples=100)
@given(st.lists(st.frozensets(st.sampled_from(_SKILLS), min_size=1), max_size=6), st.data())
def test_coalitions_are_those_with_a_place_for_each_robot(kinds: list[frozenset[str]], data: st.DataObject) -> None:
    places = data.draw(st.dictionaries(st.sampled_from(_SKILLS), st.integers(1, 2), min_size=1))
    kinds = [kind.intersection(places) for kind in kinds if kind.intersection(places)]
    size = sum(places.values())
    found = coalitions(kinds, places, size)
    seats = [skill for skill, number in places.items() for _ in range(number)]

    def is_seated(crew: Sequence[int]) -> bool:
        orders = itertools.permutations(seats)
        return any(all(kinds[robot] >= {one} for one, robot in zip(order, crew, strict=True)) for order in orders)

    complete = [crew for crew in itertools.combinations(range(len(kinds)), size) if is_seated(crew)]
    for number in range(len(kinds) + 1):
        for crew in itertools.combinations(range(len(kinds)), number):
            assert (sum(found.weights[robot] for robot in crew) in found.sums) == (crew in complete)
    assert can_fill(kinds, places, size) == bool(complete)


@pytest.mark.parametrize(
    ("now", "then", "told"),
    [
        (
            ", window: [0, 20]",
            "",
            "8: the task 'lift' has a team, which starts at the same time, and has no window (write",
        ),
        (
            "worth: 60",
            "robots: 2, worth: 60",
            "8: the task 'lift' has robots: and team: (delete robots:, since",
        ),
        (
            "camera: 1",
            "camera: 0",
            "8: the task 'lift' cannot have '0' as the number of robots with 'camera' (write an integer",
        ),
        (
            "camera: 1",
            "camera: -1",
            "8: the task 'lift' cannot have '-1' as the number of robots with 'camera' (write an integer",
        ),
        (
            "camera: 1",
            "camera: 1.5",
            "8: the task 'lift' cannot have '1.5' as the number of robots with 'camera' (write an integer",
        ),
        ("camera: 1", "camera: true", "8: the task 'lift' cannot have 'true' as the number of robots with 'camera'"),
        (
            "camera: 1",
            "camera: ",
            "8: the task 'lift' cannot have an empty value as the number of robots with",
        ),
        ("camera: 1", "camera: [1]", "8: the task 'lift' cannot have this value as the number of robots with 'camera'"),
        ("camera: 1", "camera: 16", "8: the task 'lift' has a team of 17 robots (write at most 16)"),
        ("camera: 1", "camra: 1", "8: the task 'lift' has a team with the skill 'camra', which no robot has (did you"),
        ("camera: 1", "'': 1", "8: the task 'lift' has a team with an empty skill (write its name)"),
        ("{camera: 1, gripper: 1}", "true", "8: the task 'lift' cannot have 'true' as 'team' (write team: {SKILL:"),
        ("{camera: 1, gripper: 1}", "null", "8: the task 'lift' cannot have 'null' as 'team' (write team: {SKILL:"),
        ("{camera: 1, gripper: 1}", "", "8: the task 'lift' cannot have an empty value as 'team' (write team: {SKILL:"),
        ("{camera: 1, gripper: 1}", "many", "8: the task 'lift' cannot have 'many' as 'team' (write team: {SKILL:"),
        ("{camera: 1, gripper: 1}", "{}", "8: the task 'lift' has a team without skills (write team: {SKILL:"),
        (
            "{camera: 1,",
            "{a: 1, b: 1, c: 1, d: 1, e: 1, f: 1,",
            "8: the task 'lift' has a team with 7 skills (write",
        ),
        ("worth: 60", "worth: 61", "8: the worth 61 of 'lift' cannot be divided by its 2 robots (write a multiple of"),
        ("tours: yes", "model: assignment", "8: the task 'lift' requires 2 robots; the model assignment allows one"),
    ],
)
def test_mistakes_in_teams_have_their_line(now: str, then: str, told: str, tmp_path: Path) -> None:
    assert told in mistakes(LIST.replace(now, then), tmp_path)
