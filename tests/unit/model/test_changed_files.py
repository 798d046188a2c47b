"""A changed team is one that could stand in files: it follows the format's rules, and says the same there."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from random import Random

from robochoc.formats import read_robot, read_team, write_team
from robochoc.model.change import rejoin
from robochoc.model.problem import Domain, Robot, Team
from robochoc.model.team_edits import ChangeError, without_robots
from tests.support.brute_force import solutions
from tests.support.complex_changes import random_complex_changing_team
from tests.support.problems import with_unique_definitions
from tests.support.random_changes import random_changing_team, stages
from tests.support.small_teams import triangle


def plain(robot: Robot) -> Robot:
    """`robot` with each domain in the shortest form."""
    domains = [sorted(variable.domain) for variable in robot.variables]
    single = [Domain("D", tuple(range(value, value + 1) for value in values)) for values in domains]
    own = zip(robot.variables, single, strict=True)
    return replace(robot, variables=tuple(replace(variable, domain=domain) for variable, domain in own))


def check_files(team: Team, folder: Path) -> None:
    """What is written is valid, and is read back as the same problem."""
    if any(not len(variable.domain) for variable in team.variables.values()):
        return  # files have no empty domains
    team = with_unique_definitions(team)
    write_team(team, folder, replace=True)
    read = read_team(folder)
    assert sorted(read.order) == sorted(team.order)
    for robot in team.robots:
        assert plain(read[robot.name]) == plain(robot)
    if math.prod(len(variable.domain) for variable in team.variables.values()) < 2000:
        assert {frozenset(one.items()) for one in solutions(read)} == {
            frozenset(one.items()) for one in solutions(team)
        }


def test_a_changed_team_could_stand_in_files(tmp_path: Path) -> None:
    chance = Random("files")
    for _ in range(6):
        for journey in (random_changing_team(chance, 6), random_complex_changing_team(chance, 6)):
            for team in stages(journey):
                check_files(team, tmp_path / "team")


def test_a_team_that_a_robot_rejoined_could_stand_in_files(tmp_path: Path) -> None:
    chance = Random("rejoined")
    came = 0
    for _ in range(40):
        first, *_, last = stages(random_complex_changing_team(chance, 4))
        gone = chance.sample(last.order, chance.choice((0, 0, 1)))
        last = without_robots(last, gone)
        for name in first.order:
            if name not in last:
                continue
            try:
                back = rejoin(last, first[name])
            except ChangeError:
                continue
            came += 1
            check_files(back, tmp_path / "back")
    assert came > 60


def test_a_robot_whose_file_leaves_out_what_children_are_told_rejoins(tmp_path: Path) -> None:
    folder = tmp_path / "team"
    team = triangle()
    write_team(with_unique_definitions(team), folder)
    file = folder / "RA.xml"
    file.write_text(file.read_text().replace(' variable="A"', ""))
    assert all(not child.variables for child in read_robot(file).children)
    assert rejoin(read_team(folder), read_robot(file)) == read_team(folder)
