"""`scenario.xml`: what each element says. What can be wrong with one is in `broken_scenarios.py`."""

from __future__ import annotations

from pathlib import Path

import pytest

from robochoc.formats import InvalidInputError, find_teams, read_robot, read_team
from robochoc.model.change import apply_changes, team_after_events
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    ConstraintModel,
    Predicate,
    Relation,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    ScenarioEvent,
    Team,
)
from tests.support.broken_case import TEAM, scenario, write_files
from tests.support.broken_scenarios import ADD_9, LATE, ROBOT_9, add, constraint
from tests.support.cases import looped


def team_with(folder: Path, text: str, **more: str) -> Team:
    """The team of `broken_case.py` with that scenario, and more robots below it."""
    write_files(folder / "squad", {**TEAM, "scenario.xml": text, LATE: ROBOT_9, **more})
    return read_team(folder / "squad")


def only_change(folder: Path, text: str) -> Change:
    (event,) = team_with(folder, scenario(text)).scenario
    (change,) = event.changes
    return change


@looped(
    ("text", "change"),
    [
        ('<remove_agent name="Robot2"/>', RemoveAgent("Robot2")),
        ('<remove_value variable="V2" value="7"/>', RemoveValue("V2", 7)),
        ('<remove_value variable=" V2 " value=" 07 "/>', RemoveValue("V2", 7)),
        ('<add_value variable="W1" value="-3"/>', AddValue("W1", -3)),
        ('<add_value variable="W1" value="+12"/>', AddValue("W1", 12)),
        (
            '<remove_constraint agent="Robot3" parent="Robot2" name="C5"/>',
            RemoveConstraint("Robot3", "Robot2", "C5"),
        ),
    ],
)
def test_an_element_is_a_change(tmp_path: Path, text: str, change: Change) -> None:
    assert only_change(tmp_path, text) == change


def test_added_constraints_refer_to_what_their_robots_file_defines(tmp_path: Path) -> None:
    text = add("Robot2", "Robot1", constraint("W1 V2", "N1", "r1"), constraint("W1 V2", "N2", "le"))
    (event,) = team_with(tmp_path, scenario(text)).scenario
    first, second = event.changes
    assert isinstance(first, AddConstraint)
    assert isinstance(second, AddConstraint)
    assert (first.agent, first.parent) == (second.agent, second.parent) == ("Robot2", "Robot1")
    assert isinstance(first.constraint.definition, Relation)
    assert first.constraint.definition.tuples == ((1, 1), (2, 2), (3, 3))
    assert first.constraint.model is ConstraintModel.TKC
    assert second.constraint.name == "N2"
    assert not second.constraint.allows({"W1": 2, "V2": 1})


def test_an_added_constraint_may_have_parameters_and_constants(tmp_path: Path) -> None:
    text = """<constraint model="TKC" name="N" reference="p1" scope="V1 V2 1 2"><parameters>V2 V1 2 1</parameters>
        </constraint>"""
    change = only_change(tmp_path, add("Robot2", "Robot1", text))
    assert isinstance(change, AddConstraint)
    assert change.constraint.scope == ("V1", "V2", 1, 2)
    assert change.constraint.parameters == ("V2", "V1", 2, 1)
    assert isinstance(change.constraint.definition, Predicate)


def test_an_added_robot_is_what_its_file_says(tmp_path: Path) -> None:
    change = only_change(tmp_path, ADD_9)
    assert isinstance(change, AddAgent)
    assert change.robot == read_robot(tmp_path / "squad" / LATE)
    assert Path(change.robot.file) == tmp_path / "squad" / LATE


def test_files_below_the_folder_are_no_robots_of_the_first_team(tmp_path: Path) -> None:
    team = team_with(tmp_path, scenario(ADD_9))
    assert team.order == ("Robot1", "Robot2", "Robot3")
    assert find_teams(tmp_path) == [tmp_path / "squad"]
    assert team_after_events(team, 1).order == ("Robot1", "Robot2", "Robot3", "Robot9")


def test_a_later_constraint_may_refer_to_what_an_added_file_defines(tmp_path: Path) -> None:
    team = team_with(tmp_path, scenario(ADD_9, add("Robot9", "Robot1", constraint("W1 V9", reference="far"))))
    *_, change = team.scenario[0].changes
    assert isinstance(change, AddConstraint)
    assert isinstance(change.constraint.definition, Relation)
    assert change.constraint.definition.tuples == ((1, 3), (3, 1))


def test_a_robot_may_come_again_with_other_definitions(tmp_path: Path) -> None:
    again = ROBOT_9.replace("1 3|3 1", "2 2")
    more = add("Robot9", "Robot1", constraint("W1 V9", reference="far"))
    text = scenario(ADD_9, '<remove_agent name="Robot9"/>', '<add_agent file="again/Robot9.xml"/>', more)
    team = team_with(tmp_path, text, **{"again/Robot9.xml": again})
    *_, change = team.scenario[0].changes
    assert isinstance(change, AddConstraint)
    assert isinstance(change.constraint.definition, Relation)
    assert change.constraint.definition.tuples == ((2, 2),)


def test_an_event_happens_when_the_problem_is_solved_or_after_so_many_messages(tmp_path: Path) -> None:
    text = """<scenario>
        <event after="solved"><add_value variable="V1" value="5"/><add_value variable="V1" value="6"/></event>
        <event after=" 200  messages "/>
        <event after="0 messages"><remove_value variable="V1" value="5"/></event>
    </scenario>"""
    assert team_with(tmp_path, text).scenario == (
        ScenarioEvent((AddValue("V1", 5), AddValue("V1", 6)), None),
        ScenarioEvent((), 200),
        ScenarioEvent((RemoveValue("V1", 5),), 0),
    )


def test_without_events_nothing_changes(tmp_path: Path) -> None:
    assert not team_with(tmp_path, "<scenario/>").dynamic


def test_a_change_is_held_against_the_team_as_it_stands_then(tmp_path: Path) -> None:
    text = scenario(
        '<remove_value variable="V3" value="4"/>',
        '<add_value variable="V3" value="4"/>',
        ADD_9,
        '<remove_agent name="Robot3"/>',
        add("Robot9", "Robot2", constraint("V2 V9", reference="far")),
        '<remove_constraint agent="Robot9" parent="Robot2" name="N"/>',
    )
    team = team_with(tmp_path, text)
    assert apply_changes(team, team.scenario[0].changes).order == ("Robot1", "Robot2", "Robot9")


def test_all_may_leave_when_others_come(tmp_path: Path) -> None:
    alone = ROBOT_9[: ROBOT_9.index("      <agent")] + ROBOT_9[ROBOT_9.index("    </agents_parent>") :]
    leave = [f'<remove_agent name="Robot{number}"/>' for number in (1, 2, 3)]
    team = team_with(tmp_path, scenario(*leave, '<add_agent file="alone/Robot9.xml"/>'), **{"alone/Robot9.xml": alone})
    assert team_after_events(team, 1).order == ("Robot9",)


def test_a_link_out_of_the_folder_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "Robot9.xml").write_text(ROBOT_9)
    write_files(tmp_path / "squad", {**TEAM, "scenario.xml": scenario(ADD_9)})
    (tmp_path / "squad" / "late").mkdir()
    (tmp_path / "squad" / LATE).symlink_to(tmp_path / "Robot9.xml")
    with pytest.raises(InvalidInputError, match="outside the team's folder"):
        read_team(tmp_path / "squad")


def test_a_hundred_mistakes_are_told_and_no_more(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError) as caught:
        team_with(tmp_path, scenario(*['<remove_agent name="Robot_3"/>'] * 1000))
    assert len(caught.value.diagnostics) == 101
    assert "more mistakes" in str(caught.value.diagnostics[-1])


def test_mistakes_of_an_added_file_are_told_once_however_often_it_comes(tmp_path: Path) -> None:
    broken = ROBOT_9.replace('"V9" domain="D1"', '"V9" domain="D2"')
    write_files(tmp_path, {**TEAM, "scenario.xml": scenario(ADD_9, ADD_9), LATE: broken})
    with pytest.raises(InvalidInputError, match="unknown domain") as caught:
        read_team(tmp_path)
    assert len(caught.value.diagnostics) == 1


def test_lines_of_constraints_are_the_scenarios(tmp_path: Path) -> None:
    (event,) = team_with(
        tmp_path, scenario(add("Robot3", "Robot2", constraint("V2 V3", "N1"), constraint("V2 V3", "N2")))
    ).scenario
    added: list[Constraint] = [change.constraint for change in event.changes if isinstance(change, AddConstraint)]
    assert [one.line for one in added] == [4, 5]
