"""Losses on a journey: who comes back is as its file and the scenario say. The session is made up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from robochoc.formats import PREDEFINED, read_team, write_team
from robochoc.model.change import apply_changes, team_after_events
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    ScenarioEvent,
    Team,
)
from robochoc.model.team_edits import without_robots
from robochoc.run.scenario import ScenarioRun
from robochoc.solver.compiled_team import CompiledTeam
from tests.support.losing import Losing
from tests.support.small_teams import named_constraint, triangle

CHANGES: list[Change] = [
    RemoveConstraint("RC", "RB", "C"),
    RemoveValue("C", 1),
    AddValue("C", 7),
    AddConstraint("RC", "RB", named_constraint("N", "B", "C")),
    AddConstraint("RD", "RC", named_constraint("M", "C", "D")),
]


@pytest.fixture
def team(tmp_path: Path) -> Team:
    write_team(triangle(), tmp_path / "team")
    return read_team(tmp_path / "team")


def travel(team: Team, losses: Sequence[str], spares: int = 0) -> tuple[ScenarioRun, Losing, list[Team]]:
    journey = ScenarioRun(team, None, CompiledTeam, lambda: None, spares=spares)
    session = Losing(journey.team, losses)
    return journey, session, [played.team for played in journey.epochs(session, lambda _: None)]


def test_who_is_lost_leaves(team: Team) -> None:
    journey, session, teams = travel(team, ["RB"])
    assert teams == [team, without_robots(team, ["RB"])]
    assert journey.withdrawn == ["RB"]
    assert session.epochs[0].restarted == frozenset()


def test_who_comes_back_has_the_same_problem_and_the_lowest_priority(team: Team) -> None:
    journey, session, teams = travel(team, ["RB"], spares=1)
    assert teams == [team, team]
    assert journey.withdrawn == []
    (epoch,) = session.epochs
    assert epoch.team.order == ("RA", "RC", "RD", "RB")
    assert epoch.restarted == frozenset({"RB"})
    assert "RB" in epoch.invalidated.agents


def test_so_many_come_back_as_there_are_spares(team: Team) -> None:
    journey, _, teams = travel(team, ["RB RD", "RA"], spares=1)
    assert journey.withdrawn == ["RD", "RA"]
    assert [now.order for now in teams[1:]] == [("RA", "RB", "RC"), ("RB", "RC")]


def test_who_comes_back_after_changes_has_them_too(team: Team) -> None:
    for name in ["RA", "RB", "RC", "RD"]:
        scenario = (ScenarioEvent(tuple(CHANGES)),)
        *_, last = travel(replace(team, scenario=scenario), ["", name], spares=1)[2]
        now = team_after_events(replace(team, scenario=scenario), 1)
        assert {robot.name: robot for robot in last.robots} == {robot.name: robot for robot in now.robots}


def test_changes_of_one_who_left_do_not_concern_who_comes_under_its_name(team: Team) -> None:
    again = replace(team["RD"], parents=team["RD"].parents)
    events = (ScenarioEvent((AddValue("D", 7),)), ScenarioEvent((RemoveAgent("RD"), AddAgent(again))))
    *_, last = travel(replace(team, scenario=events), ["", "", "RD"], spares=1)[2]
    assert list(last.variables["D"].domain) == [1, 2]


def test_what_the_scenario_says_of_those_who_are_lost_is_passed_over(team: Team) -> None:
    events = (
        ScenarioEvent((AddValue("D", 7), AddValue("C", 7))),
        ScenarioEvent((RemoveAgent("RD"), RemoveValue("C", 1))),
    )
    journey, _, teams = travel(replace(team, scenario=events), ["RD"])
    assert list(teams[-1].variables["C"].domain) == [2, 7]
    assert journey.withdrawn == [], "it would have left by now"


def test_a_file_that_cannot_be_read_keeps_its_robot_away(team: Team) -> None:
    Path(team["RB"].file).write_text("<instance>")
    journey, _, _ = travel(team, ["RB"], spares=1)
    assert journey.withdrawn == ["RB"]
    assert "RB could not come back" in journey.failed_returns[0]


def test_a_file_that_has_lost_a_variable_meanwhile_does_not_stop_the_scenario(team: Team) -> None:
    alone = without_robots(team, ["RA", "RB", "RC"])
    file = Path(alone["RD"].file)
    events = (ScenarioEvent((AddValue("D", 7),)),)
    text = file.read_text()
    start, end = text.index("<agents_neighbours>"), text.index("</agents_neighbours>")
    bare = text[:start] + text[end:].replace("</agents_neighbours>", "<agents_neighbours/>")
    file.write_text(bare.replace('<variable name="D"', '<variable name="E"'))
    journey, _, teams = travel(replace(alone, scenario=events), ["RD"], spares=1)
    assert journey.withdrawn == []
    assert list(teams[-1].variables) == ["E"]


def test_nobody_is_left(team: Team) -> None:
    journey, _, teams = travel(team, ["RA RB RC RD"])
    assert len(teams) == 1
    assert journey.team.robots == ()


def test_definitions_of_added_constraints_stay(team: Team) -> None:
    less = Constraint("L", PREDEFINED["lt"], ("B", "C"), ("B", "C"))
    events = (ScenarioEvent((AddConstraint("RC", "RB", less),)),)
    *_, last = travel(replace(team, scenario=events), ["", "RC"], spares=1)[2]
    assert apply_changes(team, events[0].changes)["RC"].shared == last["RC"].shared
