"""How teams change: each rule."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from robochoc.model.change import apply_changes, rejoin, team_after_events
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Child,
    ConstraintModel,
    Domain,
    Parent,
    ProblemKind,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Team,
    Variable,
)
from robochoc.model.team_edits import ChangeError, without_robots
from tests.support.cases import looped
from tests.support.problems import team_of
from tests.support.small_teams import differ, named_constraint, newcomer, triangle


def links(team: Team) -> dict[str, dict[str, tuple[str, ...]]]:
    """What each robot tells its children."""
    return {robot.name: {child.name: child.variables for child in robot.children} for robot in team.robots}


def refused(team: Team, *changes: Change) -> ChangeError:
    with pytest.raises(ChangeError) as caught:
        apply_changes(team, changes)
    assert str(caught.value) == caught.value.message
    assert caught.value.hint
    return caught.value


# Robots leave


def test_a_robot_leaves_with_its_variables_links_and_constraints() -> None:
    team = apply_changes(triangle(), [RemoveAgent("RB")])
    assert team.order == ("RA", "RC", "RD")
    assert list(team.variables) == ["A", "C", "D"]
    assert [
        (robot.name, parent.name, len(parent.constraints)) for robot in team.robots for parent in robot.parents
    ] == [
        ("RC", "RA", 1),
        ("RD", "RC", 1),
    ]
    assert links(team) == {"RA": {"RC": ("A",)}, "RC": {"RD": ("C",)}, "RD": {}}


def test_an_n_ary_constraint_goes_with_any_of_its_robots_and_the_links_of_the_others_stay() -> None:
    team = team_of(dict.fromkeys("ABC", (1, 2)), [named_constraint("N", "A", "B", "C")])
    left = without_robots(team, ["RA"])
    assert list(left.constraints()) == []
    assert [parent.name for parent in left["RC"].parents] == ["RB"]
    assert links(left) == {"RB": {"RC": ("B",)}, "RC": {}}


def test_many_leave_at_once_and_everybody_may() -> None:
    assert without_robots(triangle(), ["RA", "RC"]).order == ("RB", "RD")
    assert without_robots(triangle(), ["RA", "RB", "RC", "RD"]).robots == ()


def test_nobody_leaves_who_is_not_there() -> None:
    bad = refused(triangle(), RemoveAgent("RB"), RemoveAgent("RB"))
    assert (bad.message, bad.missing) == ("there is no robot 'RB'", "RB")


# Robots come


def test_a_robot_comes_last_and_its_parents_list_it() -> None:
    robot = newcomer(Parent("RA"), Parent("RD", (named_constraint("N", "D", "E"),)))
    team = apply_changes(triangle(), [AddAgent(robot)])
    assert team.order[-1] == "RE"
    assert team["RE"] == robot
    assert (links(team)["RA"]["RE"], links(team)["RD"]["RE"]) == ((), ("D",))


def test_a_robot_that_comes_with_an_n_ary_constraint_is_told_by_all() -> None:
    robot = newcomer(Parent("RA"), Parent("RD", (named_constraint("N", "D", "E", "A"),)))
    team = apply_changes(triangle(), [AddAgent(robot)])
    assert (links(team)["RA"]["RE"], links(team)["RD"]["RE"]) == (("A",), ("D",))


def test_a_robot_can_come_again() -> None:
    team = apply_changes(triangle(), [RemoveAgent("RA"), AddAgent(newcomer(name="RA", variable="A"))])
    assert team.order == ("RB", "RC", "RD", "RA")


@looped(
    ("robot", "message", "line"),
    [
        (newcomer(name="RA"), "the robot 'RA' is already in the team", 0),
        (newcomer(variable="A"), "the variable 'A' belongs to 'RA'", 0),
        (replace(newcomer(), kind=ProblemKind.DISWCSP), "'RE' is a DisWCSP in a team of DisCSP", 0),
        (replace(newcomer(), children=(Child("RA", line=7),)), "'RE' has the child 'RA'", 7),
        (newcomer(Parent("RX", line=8)), "there is no robot 'RX'", 8),
        (newcomer(Parent("RA", (replace(named_constraint("N", "B", "E"), line=9),))),
         "'B' belongs to 'RB', which is not a parent", 9),
        (newcomer(Parent("RA", (replace(named_constraint("N", "X", "E"), line=9),))), "no robot has the variable 'X'",
         9),
        (newcomer(Parent("RA"), Parent("RB", (replace(named_constraint("N", "A", "E"), line=9),))),
         "the scope of 'N' lacks variables of 'RE' or 'RB'", 9),
        (newcomer(Parent("RA", (replace(named_constraint("N", "A", "B", "E"), line=9),)), Parent("RB")),
         "'N' does not belong to 'RE' under 'RA'", 9),
    ],
)  # fmt: skip
def test_a_robot_that_cannot_come(robot: Robot, message: str, line: int) -> None:
    bad = refused(triangle(), AddAgent(robot))
    assert bad.message.startswith(message)
    assert bad.line == line


# Values


def test_values_go_and_come_and_the_domain_keeps_its_order() -> None:
    team = team_of({"A": (1, 2, 3), "B": (1,)}, [])
    for change, values in (
        (RemoveValue("A", 2), [1, 3]),
        (AddValue("A", -5), [-5, 1, 3]),
        (AddValue("A", 2), [-5, 1, 2, 3]),
        (RemoveValue("A", 1), [-5, 2, 3]),
    ):
        team = apply_changes(team, [change])
        assert list(team.variables["A"].domain) == values
        assert len(team.variables["A"].domain) == len(values)


def test_a_value_within_a_long_range() -> None:
    alone = Team("one", (Robot("RA", (Variable("A", Domain("D", (range(10**15),))),)),))
    team = apply_changes(alone, [RemoveValue("A", 77)])
    assert team.variables["A"].domain.ranges == (range(77), range(78, 10**15))


def test_the_last_value_may_go() -> None:
    team = apply_changes(team_of({"A": (1,)}, []), [RemoveValue("A", 1)])
    assert list(team.variables["A"].domain) == []


def test_values_that_cannot_go_or_come() -> None:
    team = team_of({"A": (1, 2, 4)}, [])
    assert refused(team, RemoveValue("A", 3)).hint == "its domain is 1..2 4"
    assert refused(team, *(RemoveValue("A", value) for value in (1, 2, 4, 4))).hint == "its domain is empty"
    assert "already" in refused(team, AddValue("A", 4)).message
    assert refused(team, AddValue("X", 4)).missing == "X"


# Constraints


def test_a_constraint_comes_to_a_pair_that_is_linked() -> None:
    team = apply_changes(triangle(), [AddConstraint("RC", "RA", named_constraint("N", "C", "A"))])
    assert [constraint.name for constraint in team["RC"].parents[0].constraints] == ["C", "N"]
    assert links(team) == links(triangle())


def test_a_constraint_links_those_who_were_not() -> None:
    team = apply_changes(triangle(), [AddConstraint("RD", "RB", named_constraint("N", "B", "D", "A"))])
    assert [parent.name for parent in team["RD"].parents] == ["RC", "RA", "RB"]
    assert (links(team)["RA"]["RD"], links(team)["RB"]["RD"]) == (("A",), ("B",))


def test_a_constraint_goes_and_its_link_stays() -> None:
    team = apply_changes(triangle(), [RemoveConstraint("RC", "RB", "C")])
    assert team["RC"].parents[1] == Parent("RB")
    assert links(team) == links(triangle())


def test_all_of_one_name_go() -> None:
    team = team_of(dict.fromkeys("AB", (1, 2)), [differ("A", "B"), named_constraint("N", "A", "B"), differ("B", "A")])
    assert [one.name for one in apply_changes(team, [RemoveConstraint("RB", "RA", "C")]).constraints()] == ["N"]


@pytest.mark.parametrize("sides", [("RA", "RB"), ("RA",), ("RB",)])
def test_both_parts_of_a_partially_known_constraint_go(sides: tuple[str, ...]) -> None:
    above, below = triangle().robots[:2]
    part = replace(named_constraint("P", "A", "B"), model=ConstraintModel.PKC)
    above = replace(above, children=(Child("RB", ("A",), (part,) if "RA" in sides else ()),))
    below = replace(below, parents=(Parent("RA", (part,) if "RB" in sides else ()),), children=())
    team = Team("pair", (above, below))
    assert len(list(team.constraints())) == len(sides)
    assert list(apply_changes(team, [RemoveConstraint("RB", "RA", "P")]).constraints()) == []


@looped(
    ("change", "message"),
    [
        (RemoveConstraint("RC", "RB", "N"), "'RC' shares no constraint 'N' with a parent 'RB'"),
        (RemoveConstraint("RB", "RC", "C"), "'RB' shares no constraint 'C' with a parent 'RC'"),
        (RemoveConstraint("RX", "RC", "C"), "there is no robot 'RX'"),
        (RemoveConstraint("RA", "RX", "C"), "there is no robot 'RX'"),
        (AddConstraint("RX", "RA", named_constraint("N", "A", "B")), "there is no robot 'RX'"),
        (AddConstraint("RB", "RX", named_constraint("N", "A", "B")), "there is no robot 'RX'"),
        (AddConstraint("RB", "RB", named_constraint("N", "A", "B")), "'RB' cannot be its own parent"),
        (AddConstraint("RB", "RA", named_constraint("N", "A", "X")), "no robot has the variable 'X'"),
        (
            AddConstraint("RC", "RA", named_constraint("N", "A", "B")),
            "the scope of 'N' lacks variables of 'RC' or 'RA'",
        ),
        (AddConstraint("RA", "RB", named_constraint("N", "A", "B")), "'N' does not belong to 'RA' under 'RB'"),
        (AddConstraint("RB", "RA", named_constraint("N", "A", "B", "C")), "'N' does not belong to 'RB' under 'RA'"),
        (AddConstraint("RC", "RA", named_constraint("N", "A", "B", "C")), "'N' does not belong to 'RC' under 'RA'"),
    ],
)
def test_constraints_that_cannot_come_or_go(change: Change, message: str) -> None:
    assert refused(triangle(), change).message == message


def test_names_in_messages_are_shortened() -> None:
    assert len(refused(triangle(), RemoveAgent("R" * 5000)).message) < 100


# Events


def test_changes_come_one_after_the_other_and_the_team_itself_stays_as_it_was() -> None:
    team = triangle()
    new = apply_changes(team, [RemoveAgent("RD"), AddAgent(newcomer(name="RD", variable="D")), AddValue("D", 7)])
    assert list(new.variables["D"].domain) == [1, 2, 7]
    assert team == triangle()
    assert apply_changes(team, []) == team


def test_changed_by_so_many_events_has_no_scenario_left() -> None:
    events = (
        ScenarioEvent((AddValue("A", 7),)),
        ScenarioEvent((AddValue("A", 8), RemoveAgent("RX"), AddValue("A", 9))),
    )
    team = replace(triangle(), scenario=events)
    for count, values in enumerate(([1, 2], [1, 2, 7], [1, 2, 7, 8, 9])):
        new = team_after_events(team, count)
        assert list(new.variables["A"].domain) == values
        assert not new.dynamic
    assert team_after_events(triangle(), 0) == triangle()


# A robot that was lost comes back


def test_a_robot_rejoins_as_its_file_says() -> None:
    team = triangle()
    less = apply_changes(team, [RemoveConstraint("RC", "RB", "C"), RemoveValue("C", 1)])
    assert rejoin(less, team["RC"]) == team


def test_a_robot_rejoins_without_those_who_have_left() -> None:
    team = triangle()
    left = without_robots(team, ["RA"])
    assert rejoin(left, team["RC"]) == left


def test_what_a_robot_tells_may_follow_from_the_constraints() -> None:
    """A file need not say it: then the reader of a single file does not know it."""
    team = triangle()
    unsaid = replace(team["RA"], children=(Child("RB"), Child("RC")))
    assert rejoin(team, unsaid) == team


def test_links_that_came_later_stay_when_a_robot_rejoins() -> None:
    team = triangle()
    later = apply_changes(
        team,
        [
            AddConstraint("RD", "RA", named_constraint("N", "A", "D")),
            AddConstraint("RC", "RA", named_constraint("N", "A", "C")),
        ],
    )
    back = rejoin(later, team["RA"])
    assert links(back)["RA"] == {"RB": ("A",), "RC": ("A",), "RD": ("A",)}
    assert [parent.name for parent in rejoin(later, team["RD"])["RD"].parents] == ["RC", "RA"]


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        (replace(triangle()["RD"], parents=(Parent("RA"),)), "'RD' lists 'RA', which was not such a neighbour before"),
        (
            replace(triangle()["RD"], parents=(), children=(Child("RC"),)),
            "'RD' lists 'RC', which was not such a neighbour",
        ),
        (newcomer(name="RD", variable="Z"), "the variable 'D', which other robots need, is missing"),
        (newcomer(name="RD", variable="A"), "the variable 'A' belongs to 'RA'"),
        (
            replace(triangle()["RD"], parents=(Parent("RC", (named_constraint("N", "D", "A"),)),)),
            "the scope of 'N' lacks variables of 'RD' or 'RC'",
        ),
    ],
)
def test_a_file_that_has_changed_meanwhile_may_not_fit(robot: Robot, message: str) -> None:
    team = triangle()
    below = team_of(dict.fromkeys("ABCDE", (1, 2)), [differ("D", "E")])["RE"]
    above = replace(team["RD"], children=(Child("RE", ("D",)),))
    team = replace(team, robots=(*team.robots[:3], above, below))
    with pytest.raises(ChangeError, match=re.escape(message)):
        rejoin(team, robot)
