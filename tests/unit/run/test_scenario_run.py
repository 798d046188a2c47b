"""A team on its way through events and losses: who comes back is as its file and the scenario say.

The session is made up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from robochoc.communication.session import Epoch
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.formats import PREDEFINED, read_team, write_team
from robochoc.model.change import apply_changes, team_after_events
from robochoc.model.outcome import Verdict
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    Domain,
    Parent,
    Relation,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Semantics,
    Team,
    Variable,
)
from robochoc.model.team_edits import without_robots
from robochoc.protocols.satisfaction.dynabt import DynABT
from robochoc.run import Options, Runtime, solve
from robochoc.run.scenario import FinishedEpoch, ScenarioRun
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.explanation import invalidated_by
from tests.support.losing import Losing
from tests.support.problems import team_of
from tests.support.small_teams import differ, named_constraint, newcomer, triangle

CHANGES: list[Change] = [
    RemoveConstraint("RC", "RB", "C"),
    RemoveValue("C", 1),
    AddValue("C", 7),
    AddConstraint("RC", "RB", named_constraint("N", "B", "C")),
    AddConstraint("RD", "RC", named_constraint("M", "C", "D")),
]


@pytest.fixture
def team(tmp_path: Path) -> Team:
    """Four robots, with files that can be read again."""
    write_team(triangle(), tmp_path / "team")
    return read_team(tmp_path / "team")


def event(*changes: Change) -> ScenarioEvent:
    return ScenarioEvent(changes)


def travel(
    team: Team, losses: Sequence[str], *, spares: int = 0, messages: int | None = None
) -> tuple[ScenarioRun, Losing, list[FinishedEpoch]]:
    journey = ScenarioRun(team, None, CompiledTeam, lambda: None, messages=messages, spares=spares)
    session = Losing(journey.team, losses)
    return journey, session, list(journey.epochs(session, lambda _: None))


def test_who_is_lost_leaves_and_the_others_go_on(team: Team) -> None:
    journey, session, played = travel(team, ["RB"])
    assert [one.team for one in played] == [team, without_robots(team, ["RB"])]
    assert journey.lost_for_good == ["RB"]
    assert session.epochs[0].restarted == frozenset()
    assert "RB" in session.epochs[0].invalidated.agents


def test_who_comes_back_has_the_same_problem_and_the_lowest_priority(team: Team) -> None:
    journey, session, played = travel(team, ["RB"], spares=1)
    assert [one.team for one in played] == [team, team]
    assert journey.lost_for_good == []
    (epoch,) = session.epochs
    assert epoch.team.order == ("RA", "RC", "RD", "RB")
    assert epoch.restarted == frozenset({"RB"})
    assert "RB" in epoch.invalidated.agents


def test_so_many_come_back_as_there_are_spares(team: Team) -> None:
    journey, session, played = travel(team, ["RB RD", "RA"], spares=1)
    assert journey.lost_for_good == ["RD", "RA"]
    assert [one.team.order for one in played[1:]] == [("RA", "RB", "RC"), ("RB", "RC")]
    assert [epoch.team.order for epoch in session.epochs] == [("RA", "RC", "RB"), ("RC", "RB")]
    assert [epoch.restarted for epoch in session.epochs] == [{"RB"}, set()]


def test_who_comes_back_after_changes_has_them_too(team: Team) -> None:
    changing = replace(team, scenario=(event(*CHANGES), event(AddValue("C", 1))))
    for name in team.order:
        played = travel(changing, ["", name], spares=1)[2]
        for one, events in zip(played, (0, 1, 1, 2), strict=True):
            now = team_after_events(changing, events)
            assert {robot.name: robot for robot in one.team.robots} == {robot.name: robot for robot in now.robots}


def test_changes_of_one_who_left_do_not_concern_who_comes_under_its_name(team: Team) -> None:
    again = replace(team["RD"], parents=team["RD"].parents)
    events = (event(AddValue("D", 7)), event(RemoveAgent("RD"), AddAgent(again)))
    *_, last = travel(replace(team, scenario=events), ["", "", "RD"], spares=1)[2]
    assert list(last.team.variables["D"].domain) == [1, 2]


def test_events_go_on_without_those_that_were_lost(team: Team) -> None:
    link = Parent("RA", (differ("A", "E"),)), Parent("RB", (differ("B", "E"),))
    events = (
        event(AddValue("B", 7), AddValue("C", 7), AddAgent(newcomer(*link))),
        event(RemoveAgent("RB"), RemoveValue("C", 1)),
        event(RemoveValue("E", 1)),
    )
    journey, _, played = travel(replace(team, scenario=events), ["RB"])
    others = ("RA", "RC", "RD")
    assert [one.team.order for one in played] == [team.order, others, *[(*others, "RE")] * 3]
    last = played[-1].team
    assert [parent.name for parent in last["RE"].parents] == ["RA"]
    assert [[*last.variables[name].domain] for name in "CE"] == [[2, 7], [2]]
    assert journey.lost_for_good == [], "it would have left by now"


def test_a_team_that_all_have_left_may_be_joined() -> None:
    base = team_of(dict.fromkeys("ABC", range(1, 4)), [differ("A", "B"), differ("B", "C")])
    team = replace(base, scenario=(event(*map(RemoveAgent, base.order)), event(AddAgent(newcomer()))))
    assert [one.team.order for one in travel(team, [])[2]] == [base.order, (), ("RE",)]
    news = iter(team.scenario)
    here = Options(protocol="dynabt", runtime=Runtime.SIMULATOR)
    outcome = solve(base, here, environment=lambda *_: next(news, None))  # a scenario must leave somebody, as in files
    assert [str(epoch.verdict) for epoch in outcome.epochs] == ["solution"] * 3


def test_a_file_that_cannot_be_read_keeps_its_robot_away(team: Team) -> None:
    Path(team["RB"].file).write_text("<instance>")
    journey, _, _ = travel(team, ["RB"], spares=1)
    assert journey.lost_for_good == ["RB"]
    assert "RB could not come back" in journey.failed_returns[0]


def test_a_file_that_has_lost_a_variable_meanwhile_does_not_stop_the_scenario(team: Team) -> None:
    alone = without_robots(team, ["RA", "RB", "RC"])
    file = Path(alone["RD"].file)
    text = file.read_text()
    start, end = text.index("<agents_neighbours>"), text.index("</agents_neighbours>")
    bare = text[:start] + text[end:].replace("</agents_neighbours>", "<agents_neighbours/>")
    file.write_text(bare.replace('<variable name="D"', '<variable name="E"'))
    journey, _, played = travel(replace(alone, scenario=(event(AddValue("D", 7)),)), ["RD"], spares=1)
    assert journey.lost_for_good == []
    assert list(played[-1].team.variables) == ["E"]


def test_nobody_is_left(team: Team) -> None:
    journey, _, played = travel(team, ["RA RB RC RD"])
    assert [set(one.result.lost) for one in played] == [{*team.order}]
    assert journey.team.robots == ()


def test_definitions_of_added_constraints_stay(team: Team) -> None:
    less = Constraint("L", PREDEFINED["lt"], ("B", "C"), ("B", "C"))
    added = event(AddConstraint("RC", "RB", less))
    *_, last = travel(replace(team, scenario=(added,)), ["", "RC"], spares=1)[2]
    assert apply_changes(team, added.changes)["RC"].shared == last.team["RC"].shared


def test_messages_are_counted_over_all_epochs(team: Team) -> None:
    changing = replace(team, scenario=(event(AddValue("A", 8)), event(AddValue("A", 9))))
    _, session, played = travel(changing, [], messages=10)
    assert session.limits == [10, 3]
    assert [one.result.verdict for one in played] == [Verdict.SOLUTION, Verdict.SOLUTION, Verdict.UNKNOWN]


# DynABT between two changes


def test_two_changes_in_a_row_tell_a_new_child() -> None:
    team = team_of(
        {"A": range(1, 4), "B": range(1, 4), "C": range(3, 5), "D": range(3, 5), "Z": range(1, 4)},
        [differ("A", "C"), differ("B", "D")],
    )
    linked = apply_changes(team, [AddConstraint("RB", "RA", differ("A", "B"))])
    less = apply_changes(linked, [RemoveAgent("RZ")])
    session = Simulation(team, DynABT, Concurrent(0))
    session.search()
    session.change(Epoch(CompiledTeam(linked), invalidated_by(team, linked)))  # and before the search goes on
    session.change(Epoch(CompiledTeam(less), invalidated_by(linked, less)))
    result = session.search()
    assert result.verdict is Verdict.SOLUTION
    assert result.assignments["RA"]["A"] != result.assignments["RB"]["B"]


def test_links_that_were_asked_for_outlive_a_change_of_the_interface() -> None:
    def forbids(name: str, scope: tuple[str, ...], *rows: tuple[int, ...]) -> Constraint:
        return Constraint(name, Relation("R", len(scope), Semantics.CONFLICTS, rows), scope, scope)

    def variable(name: str, *values: int) -> Variable:
        return Variable(name, Domain("D", tuple(range(value, value + 1) for value in values)))

    robots = (
        Robot("P", (variable("p", 1),)),
        Robot("X", (variable("x", 1, 2),)),
        Robot("V", (variable("v", 1, 2), variable("w", 1))),
        Robot("Y", (variable("y", 1),)),
    )
    team = apply_changes(
        Team("links", robots),
        [
            AddConstraint("V", "P", forbids("q", ("p", "w"), (5, 5))),
            AddConstraint("Y", "V", forbids("c", ("x", "v", "y"), (1, 1, 1), (2, 1, 1))),
        ],
    )
    hidden = ScenarioEvent((RemoveConstraint("V", "P", "q"), RemoveValue("x", 1)))
    outcome = solve(
        replace(team, scenario=(hidden,)), Options(protocol="dynabt", runtime=Runtime.SIMULATOR, messages=500)
    )
    assert outcome.verdict is Verdict.SOLUTION
