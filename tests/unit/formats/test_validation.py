"""Teams built in Python: the rules for files hold of them, with the same messages, wherever they come from."""

from __future__ import annotations

import copy
import gc
import re
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import robochoc
from robochoc.formats import (
    PREDEFINED,
    Diagnostic,
    InvalidInputError,
    check_robot,
    check_team,
    read_team,
    robot_xml,
    write_team,
)
from robochoc.formats import validation as validating
from robochoc.formats.robot_validation import RobotValidator
from robochoc.generators.queens3d import queens3d
from robochoc.model.change import apply_changes
from robochoc.model.orders import with_priorities
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    Domain,
    ProblemKind,
    Relation,
    RemoveAgent,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Semantics,
    Team,
    Variable,
)
from robochoc.run import solve
from robochoc.run.options import Options, Runtime
from tests.support.broken import CASES
from tests.support.broken_case import TEAM, write_files
from tests.support.broken_objects import AS_IN_FILES, OF_OBJECTS
from tests.support.cases import looped
from tests.support.complex_problems import random_complex_team
from tests.support.examples import examples
from tests.support.growth import steps_of
from tests.support.problems import random_team, team_of
from tests.support.team_mutations import mutated

HERE = Options(runtime=Runtime.SIMULATOR)
FILE_CASES = {case.name: case for case in CASES}


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Team:
    """The team of the broken cases, which is not broken."""
    folder = tmp_path_factory.mktemp("valid")
    write_files(folder, TEAM)
    return read_team(folder)


def refused(team: Team, folder: Path | None = None) -> InvalidInputError:
    """Return why a team is not valid. Nothing of it is written either."""
    if folder:
        with pytest.raises(InvalidInputError):
            write_team(team, folder / "written")
        assert not list(folder.glob("*written*"))
    with pytest.raises(InvalidInputError) as caught:
        check_team(team)
    return caught.value


def told(invalid: InvalidInputError) -> list[str]:
    """The messages; places in expressions depend on how they are written."""
    return sorted(one.message.partition(", at character")[0] for one in invalid.diagnostics)


# Each rule


@looped("name", AS_IN_FILES)
def test_the_messages_are_those_for_files(name: str, team: Team, tmp_path: Path) -> None:
    case = FILE_CASES[name]
    case.write(tmp_path)
    with pytest.raises(InvalidInputError) as of_files:
        read_team(tmp_path)
    of_objects = refused(AS_IN_FILES[name](team), tmp_path)
    assert told(of_objects) == told(of_files.value)
    assert all(one.file.startswith("robot ") and not one.line for one in of_objects.diagnostics)


@looped("name", OF_OBJECTS)
def test_what_only_objects_can_get_wrong(name: str, team: Team, tmp_path: Path) -> None:
    case = OF_OBJECTS[name]
    found = refused(case.breakage(team), tmp_path).diagnostics
    assert len(found) == len(case.expected), found
    for diagnostic, (place, message) in zip(found, case.expected, strict=True):
        assert place in diagnostic.file
        assert message in diagnostic.message
        assert len(str(diagnostic)) < 600
        assert "\n" not in str(diagnostic)


def test_every_case_breaks_the_team(team: Team) -> None:
    check_team(team)
    assert len({*AS_IN_FILES, *OF_OBJECTS}) == len(AS_IN_FILES) + len(OF_OBJECTS) >= 90
    assert AS_IN_FILES.keys() <= FILE_CASES.keys()


def test_lines_of_files_are_not_believed(team: Team) -> None:
    """A robot that was read and then changed is not what its file says."""
    apply_changes = AS_IN_FILES["a variable that its owner does not have"](team)
    assert apply_changes["Robot3"].file
    (mistake,) = refused(apply_changes).diagnostics
    assert str(mistake).startswith("robot Robot3, constraint C4 (V9 V3): no robot has the variable 'V9' (")


def test_two_thousand_mistakes_are_not_all_told(team: Team) -> None:
    row = replace(team["Robot1"].private[0], scope=(1, 2), parameters=(1, 2))
    rows = [replace(row, name=f"C{number}") for number in range(2000)]
    many = (replace(team["Robot1"], private=tuple(rows)), *team.robots[1:])
    found = refused(replace(team, robots=many)).diagnostics
    assert len(found) == 101


def test_a_robot_alone(team: Team) -> None:
    check_robot(team["Robot3"])
    with pytest.raises(InvalidInputError, match=r"robot Robot1: weight=.0. in"):
        check_robot(OF_OBJECTS["a weight of 0"].breakage(team)["Robot1"])


# Whoever solves


def costly() -> Team:
    """Soft costs, and the best assignment is not the first."""
    rows = tuple((one, other) for one in range(1, 4) for other in range(1, 4))
    soft = Relation("r", 2, Semantics.SOFT, rows, tuple(32 if one == other == 1 else 11 for one, other in rows), 0)
    team = team_of({"A": range(1, 4), "B": range(1, 4)}, [Constraint("C", soft, ("A", "B"), ("A", "B"))])
    return replace(team, robots=tuple(replace(one, kind=ProblemKind.DISWCSP) for one in team.robots))


def test_costs_in_a_discsp_are_not_called_a_solution() -> None:
    assert solve(costly(), replace(HERE, protocol="sfb")).cost == 11
    wrong = replace(costly(), robots=tuple(replace(one, kind=ProblemKind.DISCSP) for one in costly().robots))
    for attempt in (lambda: solve(wrong, HERE), lambda: robochoc.Problem(wrong)):
        with pytest.raises(InvalidInputError, match="a DisCSP cannot have a soft relation"):
            attempt()


def test_parents_that_are_left_out_are_missed() -> None:
    """It was `optimal`, verified, with two equal values that a constraint forbids."""
    team = team_of({"A": range(1, 3), "B": range(1, 3)}, [Constraint("C", PREDEFINED["ne"], ("A", "B"), ("A", "B"))])
    assert solve(team, HERE).verified
    first, second = team.robots
    with pytest.raises(InvalidInputError, match="'RB' does not list 'RA' as its parent"):
        solve(replace(team, robots=(first, replace(second, parents=()))), HERE)
    with pytest.raises(InvalidInputError, match="the child 'RB' is not in the team"):
        solve(replace(team, robots=(first,)), HERE)


@pytest.mark.parametrize("protocol", ["abt", "central"])
def test_nothing_is_solved_or_told_of_an_invalid_team(protocol: str, team: Team) -> None:
    events: list[object] = []
    broken = AS_IN_FILES["a DisWCSP among DisCSPs"](team)
    with pytest.raises(InvalidInputError, match="the robot is a DisWCSP"):
        solve(broken, replace(HERE, protocol=protocol), observer=events.append)
    assert events == []


def test_what_changes_leave_can_be_solved(team: Team) -> None:
    for change in (RemoveAgent("Robot2"), RemoveValue("V2", 3), RemoveAgent("Robot1")):
        check_team(apply_changes(team, [change]))
    simple = team_of({"A": range(1, 3), "B": range(1, 3)}, [])
    dynamic = replace(simple, scenario=(ScenarioEvent((RemoveAgent("RB"), RemoveValue("A", 1))), ScenarioEvent(())))
    assert solve(dynamic, HERE).assignment == {"A": 2}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (AddConstraint("RB", "RA", Constraint("C", PREDEFINED["ne"], ("A", "B"), ("A", "B"), cost=3)),
         "a DisCSP cannot have costs"),
        (AddConstraint("RC", "RA", Constraint("C", PREDEFINED["ne"], ("A", "C"), ("A",))),
         "requires 2 terms, but there are 1: 'A'"),
        (AddAgent(Robot("RC", (Variable("C", Domain("D", ())),))), "domain D has no value"),
        (AddValue("A", 10**18), "19 digits"),
        ("nonsense", "'nonsense' instead of RemoveAgent or AddAgent"),
    ],
)  # fmt: skip
def test_what_a_field_says_is_held_against_the_rules(change: Change, message: str) -> None:
    team = team_of({"A": range(1, 3), "B": range(1, 3)}, [])
    newcomer = AddAgent(Robot("RC", (Variable("C", Domain("D", (range(2),))),)))
    event = ScenarioEvent((newcomer, change))
    with pytest.raises(InvalidInputError, match=message):
        solve(team, replace(HERE, protocol="dynabt"), environment=lambda *_: event)


# Found valid once


def test_a_team_that_was_read_is_not_looked_at_again(team: Team, monkeypatch: pytest.MonkeyPatch) -> None:
    looked_at: list[str] = []
    mistakes = RobotValidator.mistakes

    def watched(validator: RobotValidator, robot: Robot) -> list[Diagnostic]:
        looked_at.append(robot.name)
        return mistakes(validator, robot)

    monkeypatch.setattr(RobotValidator, "mistakes", watched)
    check_team(team)
    robochoc.Problem(team)
    assert looked_at == []
    for another in (replace(team), replace(team, name="x"), copy.copy(team), copy.deepcopy(team)):
        looked_at.clear()
        check_team(another)
        check_team(another)
        assert looked_at == ["Robot1", "Robot2", "Robot3"]


def test_what_is_made_of_a_valid_team_is_not_valid_by_that(team: Team) -> None:
    check_team(team)
    with pytest.raises(InvalidInputError):
        check_team(replace(team, robots=team.robots[1:]))
    invalid = AS_IN_FILES["a DisCSP cannot have costs"](team)
    for _ in range(2):
        refused(invalid)


def test_teams_that_are_gone_are_forgotten(team: Team) -> None:
    gc.collect()
    before = len(validating._valid)  # noqa: SLF001
    for number in range(50):
        check_team(replace(team, name=f"team {number}"))
    gc.collect()
    assert len(validating._valid) <= before  # noqa: SLF001


def test_a_large_team_takes_as_many_steps_for_each_constraint_as_a_small_one() -> None:
    def steps(n: int) -> float:
        team = replace(queens3d(n), name=f"queens of {n}")
        return steps_of(lambda: check_team(team)) / len(list(team.constraints()))

    assert steps(9) < steps(4)


# Orders


def test_an_order_may_say_more_than_the_links() -> None:
    chance = Random(5)
    for number in range(30):
        drawn = random_team(Random(number))
        names = list(drawn.order)
        chance.shuffle(names)
        check_team(with_priorities(drawn, names))
    apart = Team("apart", tuple(team_of({name: range(2)}, []).robots[0] for name in "BAC"))
    check_team(apart)


# What is valid can be written, and is read back


def draw(seed: int) -> Team:
    return random_complex_team(Random(seed)) if seed % 2 else random_team(Random(seed))


def same(one: Team, other: Team) -> bool:
    """Whether two teams are equal but for their names, and names of definitions."""
    return [robot_xml(robot) for robot in one.robots] == [robot_xml(robot) for robot in other.robots]


def test_what_files_cannot_say_is_not_written(team: Team, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.formats.xml.MAX_BYTES", 2 * 1024 * 1024)
    showing = replace(team, robots=(*team.robots[:2], replace(team["Robot3"], shown=("V3",))))
    big = Relation("r", 3, Semantics.CONFLICTS, tuple((10**17 + number, 10**17, 10**17) for number in range(40_000)))
    large = team_of({"A": range(2), "B": range(2)}, [Constraint("C", big, ("A", "B", 1), ("A", "B", 1))])
    for unwritable, why in ((showing, "`shown` contains 'V3'"), (large, "larger than 2 MiB")):
        check_team(unwritable)
        with pytest.raises(InvalidInputError, match=why):
            write_team(unwritable, tmp_path / "team")
        assert list(tmp_path.iterdir()) == []


# Valid here is valid there


def files_of(team: Team) -> dict[str, bytes]:
    return {f"{robot.name}.xml": robot_xml(robot) for robot in team.robots}


def without_places(messages: list[str]) -> list[str]:
    """A missing neighbour is a missing file, or a missing robot; in a file, the second domain D9 is called D9.2."""
    renamed = (re.sub(r"\bD9\.\d+", "D9", one) for one in messages)
    return sorted(one.partition(" has no file")[0].partition(" is not in the team")[0] for one in renamed)


@examples(100)
@given(seed=st.integers(0, 2**32), times=st.integers(1, 2))
@example(seed=65, times=2)  # two equal domains, both too large
@example(seed=2645, times=2)  # two constraints of one name and scope, both misplaced
def test_valid_here_is_valid_there(tmp_path_factory: pytest.TempPathFactory, seed: int, times: int) -> None:
    chance = Random(seed)
    team = draw(seed)
    for _ in range(times):
        team = mutated(team, chance)
    folder = tmp_path_factory.mktemp("mutated")
    write_files(folder, files_of(team))
    try:
        again = read_team(folder)
    except InvalidInputError as invalid:
        of_files = told(invalid)
    else:
        of_files = []
        assert same(again, team)
    try:
        check_team(team)
    except InvalidInputError as invalid:
        of_objects = told(invalid)
    else:
        of_objects = []
    assert without_places(of_objects) == without_places(of_files)
