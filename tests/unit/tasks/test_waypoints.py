"""Waypoints of lists: the formulas in the robots' files give the first place of each set of tasks."""

from __future__ import annotations

import itertools
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import yaml

from robochoc.flight.mission import mission_of
from robochoc.formats import read_team, write_team
from robochoc.formats.problems import read_problem
from robochoc.formats.team_reader import GROUND_FILE
from robochoc.maps.ground_map import GroundMap, read_ground_map
from robochoc.model.constraint import Relation
from robochoc.model.expression import evaluate
from robochoc.model.problem import Robot
from robochoc.run import Options, Runtime, solve
from tests.support.random_task_lists import Meaning, random_list, read_or_refused, written
from tests.support.task_lists import LIST, imported, mistakes


def place_of(robot: Robot, values: dict[str, int], scale: float) -> tuple[float, ...]:
    (topic,) = robot.topics
    assert topic.x is not None
    assert topic.y is not None
    assert topic.z is not None
    return tuple(evaluate(one, values) * scale for one in (topic.x, topic.y, topic.z))


def sets_of(meaning: Meaning, robot: dict[str, Any], team_robot: Robot) -> Any:  # noqa: ANN401 - pairs
    """Yield each set of tasks, with the values of the robot's variables."""
    for tasks, _ in meaning.sets(robot):
        if meaning.model == "assignment":
            (only,) = team_robot.variables
            label = tasks[0] if tasks else "none"
            yield tasks, {only.name: next(value for value in only.domain if only.domain.label(value) == label)}
        else:
            chosen = {f"{team_robot.name}.{name}" for name in tasks}
            values = {one.name: int(one.name in chosen) for one in team_robot.variables}
            yield tasks, values | tour_of(team_robot, values)


def tour_of(robot: Robot, values: dict[str, int]) -> dict[str, int]:
    """Return the value of the variable with the number of the tour, if the robot has one."""
    for one in robot.private:
        if one.name == "tour":
            assert isinstance(one.definition, Relation)
            tour, *does = one.variables
            wanted = [values[name] for name in does]
            return {tour: next(number for number, *row in one.definition.tuples if row == wanted)}
    return {}


def first_places(meaning: Meaning, robot: dict[str, Any], tasks: tuple[str, ...]) -> set[tuple[float, ...]]:
    """Return the places at which the shortest tours in time begin; without tours, the nearest place."""
    placed = [meaning.tasks[name] for name in tasks if meaning.tasks[name].get("at")]
    found: dict[tuple[float, ...], Fraction] = {}
    for order in itertools.permutations(placed):
        if meaning.is_touring:
            stops = [robot["at"], *(task["at"] for task in order)]
            times = [*itertools.accumulate(meaning.length(*leg, 9) for leg in itertools.pairwise(stops))]
            if any(time > meaning.time(robot, task) for time, task in zip(times, order, strict=True)):
                continue
            length = times[-1] if times else Fraction()
        else:
            length = meaning.length(robot["at"], order[0]["at"], 9) if order else Fraction()
        first = tuple(map(float, order[0]["at"] if order else robot["at"]))
        found[first] = min(length, found.get(first, length))
    return {first for first, length in found.items() if length == min(found.values())}


def check_stops(ground: GroundMap, team_robot: Robot, tasks: tuple[str, ...], values: dict[str, int]) -> None:
    """Assert that the stops are the places of these tasks, and begin with the waypoint."""
    scale = ground.scale or 1.0
    known = ground.stops.get(team_robot.name)
    assert known or not tasks
    stops = known.of(values) if known else []
    assert {one.variable.rpartition(".")[2] for one in stops} <= {*tasks, "task"}
    assert len({(one.variable, one.value) for one in stops}) == len(stops)
    assert all(values[one.variable] == one.value for one in stops)
    if stops:
        assert tuple(part * scale for part in stops[0].at) == place_of(team_robot, values, scale)


def test_waypoints_are_the_first_places_of_random_lists(tmp_path: Path) -> None:
    chance, checked = Random("waypoints"), 0
    for _ in range(60):
        told = random_list(chance)
        path = tmp_path / "tasks.yaml"
        path.write_text(written(told, "block"))
        team, _ = read_or_refused(path)
        if team is None:
            continue
        files = imported(path.read_text(), tmp_path).files
        ground = read_ground_map(files[GROUND_FILE]) if files else None
        scale = ground.scale if ground else 1.0
        meaning = Meaning(told)
        for name, robot in meaning.robots.items():
            mine = team.get(name)
            if mine is None or not robot.get("at"):
                assert mine is None or not mine.topics
                continue
            for tasks, values in sets_of(meaning, dict(robot), mine):
                found = place_of(mine, values, scale or 1.0)
                if ground is not None:
                    check_stops(ground, mine, tasks, values)
                expected = first_places(meaning, dict(robot), tasks)
                rounded = {tuple(round(part, 6) for part in (*one, 0.0)[:3]) for one in expected}
                assert tuple(round(part, 6) for part in found) in rounded, f"{name} {tasks}\n{path.read_text()}"
                checked += 1
    assert checked > 100


def test_a_list_is_flown_from_the_robots_positions(tmp_path: Path) -> None:
    result = imported(LIST.replace("[8, 1]", "[8, 1.5]").replace("streets", "streets\ntours: yes"), tmp_path)
    ground = read_ground_map(result.files[GROUND_FILE])
    outcome = solve(result.team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    mission = mission_of(outcome, result.team, ground=ground, exact=True)
    assert {one.name: one.home[:2] for one in mission.drones} == {"ann": (0, 0), "bob": (8, 1.5), "cid": (4, 6)}
    goals = {mission.drones[number].name: goal.at for number, goal in mission.legs[0].goals.items()}
    assert goals == {"ann": (3, 4, 0), "bob": (7, 3, 0), "cid": (5, 5, 0)}


def test_a_robot_may_have_another_topic_and_the_folder_has_the_same(tmp_path: Path) -> None:
    text = LIST.replace("most: 2}", "most: 2, topic: /bobs/goal}")
    problem = imported(text, tmp_path)
    write_team(problem.team, tmp_path / "team")
    for team in (problem.team, read_team(tmp_path / "team")):
        assert {robot.name: [topic.name for topic in robot.topics] for robot in team.robots} == {
            "ann": ["/ann/waypoint"],
            "bob": ["/bobs/goal"],
            "cid": ["/cid/waypoint"],
        }
    assert mistakes(text.replace("/bobs/goal", '"/bobs goal"'), tmp_path).startswith("3: ")
    assert "cannot have '7' as 'topic'" in mistakes(text.replace("/bobs/goal", "7"), tmp_path)
    both = text.replace("capacity: 3}", "capacity: 3, topic: /bobs/goal}", 1)
    assert "the robots 'ann' and 'bob' have the same topic" in mistakes(both, tmp_path)


def test_robots_with_too_many_tasks_get_a_note(tmp_path: Path) -> None:
    tasks = {f"task{number}": {"at": [number, number % 7], "worth": 90} for number in range(900)}
    path = tmp_path / "tasks.yaml"
    path.write_text(yaml.safe_dump({"robots": {"ann": {"at": [0, 0]}}, "tasks": tasks}))
    problem = read_problem(path)
    assert problem.team["ann"].topics == ()
    assert [note for note in problem.notes if note[0] == "topic"] == [
        ("topic", "the topic of the robot ann, which has too many tasks for a formula")
    ]


def test_positions_too_far_away_have_no_map(tmp_path: Path) -> None:
    text = "robots: {ann: {at: [0, 0]}, bob: {at: [3000000, 1]}}\ntasks: {dig: {worth: 3, at: [1, 1]}}"
    assert imported(text, tmp_path).files == {}
    assert len(imported(text, tmp_path).team["ann"].topics) == 1
    assert imported(text.replace("[1, 1]", "[0.5, 1]"), tmp_path).team["ann"].topics == ()
