"""Robots and teams as XML: docs/reference/format.md, and Figure 2 as it stands in the paper."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from lxml import etree

from robochoc.formats import (
    PREDEFINED,
    Diagnostic,
    InvalidInputError,
    find_teams,
    read_robot,
    read_team,
    robot_xml,
    write_atomically,
)
from robochoc.model.expression import Apply, Constant, Name, text
from robochoc.model.problem import (
    Child,
    Constraint,
    ConstraintModel,
    Domain,
    Parent,
    Predicate,
    ProblemKind,
    Relation,
    Robot,
    Semantics,
    Team,
    Topic,
    Variable,
)
from tests.support.broken_case import TEAM, write_files
from tests.support.examples import examples
from tests.support.growth import steps_of
from tests.support.program import ROOT
from tests.support.random_robots import random_robots

DATA = ROOT / "tests" / "data"
FIGURE_2 = DATA / "figure2" / "Robot3.1.xml"
JCHOC = ROOT.parent / "shared" / "data" / "jchoc"
XSD = ROOT / "xsd"


def test_figure_2_says_what_the_paper_says() -> None:
    robot = read_robot(FIGURE_2)
    assert robot.name == "Robot3.1"
    assert robot.kind is ProblemKind.DISCSP
    assert [(variable.name, list(variable.domain)) for variable in robot.variables] == [("V3.1", [1, 2, 3, 4])]
    assert robot.topics == (Topic("/drone3.1/waypoint3.1"),)
    assert [parent.name for parent in robot.parents] == ["Robot1.1", "Robot2.1", "Robot1.3", "Robot2.2"]
    assert [child.name for child in robot.children] == ["Robot4.1", "Robot3.2", "Robot3.3", "Robot3.4", "Robot4.2"]
    assert {child.variables for child in robot.children} == {("V3.1",)}
    first, second, third, fourth = robot.shared
    assert first.scope == first.parameters == ("V1.1", "V3.1", 1, 3)
    assert isinstance(first.definition, Predicate)
    assert text(first.definition.body) == "and(ne(X,Y),ne(abs(sub(X,Y)),abs(sub(i,j))))"
    assert second.definition is first.definition
    assert third.definition == fourth.definition == PREDEFINED["neq"]
    assert {constraint.model for constraint in robot.shared} == {ConstraintModel.TKC}
    assert first.allows({"V1.1": 1, "V3.1": 2})
    assert not first.allows({"V1.1": 1, "V3.1": 3})


def test_figure_2_is_written_as_it_stands() -> None:
    written = robot_xml(read_robot(FIGURE_2)).decode().splitlines()
    printed = FIGURE_2.read_text().replace('" />', '"/>').splitlines()
    assert len(written) == len(printed) == 60
    functional = next(number for number, line in enumerate(printed) if "<functional>" in line)
    assert [line for number, line in enumerate(written) if number != functional] == [
        line for number, line in enumerate(printed) if number != functional
    ]


@pytest.mark.parametrize(("schema", "file"), [("robot.xsd", FIGURE_2), ("robot.xsd", DATA / "complex" / "A1.xml")])
def test_schemas_stand_alone(schema: str, file: Path) -> None:
    assert etree.XMLSchema(file=str(XSD / schema)).validate(etree.parse(str(file)))


@pytest.mark.skipif(not JCHOC.is_dir(), reason="the original platform's files are not here")
def test_the_original_platforms_team() -> None:
    team = read_team(JCHOC)
    assert team.order == ("A1", "A2", "A3")
    assert len(team.variables) == 12
    assert [len(robot.private) for robot in team.robots] == [4, 4, 4]
    assert [len(robot.shared) for robot in team.robots] == [0, 11, 22]
    assert all(child.constraints == () for robot in team.robots for child in robot.children)
    assert {child.name: child.variables for child in team["A2"].children} == {"A3": ("X2.1", "X2.2", "X2.3", "X2.4")}
    relation = team["A1"].private[0].definition
    assert isinstance(relation, Relation)
    assert (relation.semantics, relation.arity, len(relation.tuples)) == (Semantics.CONFLICTS, 2, 12)


def test_copies_in_other_words_are_checked_and_dropped() -> None:
    team = read_team(DATA / "complex")
    assert team.order == ("A1", "A2")
    (child,) = team["A1"].children
    assert child.variables == ("X1.1", "X1.3")
    assert child.constraints == ()
    assert len(team["A2"].shared) == 3
    assert len(list(team.constraints())) == 5
    assert {constraint.model for constraint in team["A1"].private} == {ConstraintModel.TKC}  # as their file says


def test_a_team_in_priority_order(tmp_path: Path) -> None:
    write_files(tmp_path / "squad", TEAM)
    team = read_team(tmp_path / "squad")
    assert team.name == "squad"
    assert not team.dynamic
    assert team.order == ("Robot1", "Robot2", "Robot3")
    assert team.owner == {"V1": "Robot1", "W1": "Robot1", "V2": "Robot2", "V3": "Robot3"}
    assert team["Robot3"].interface == ("V3",)
    (part,) = team["Robot1"].children[0].constraints
    assert part.model is ConstraintModel.PKC
    (topic,) = team["Robot3"].topics
    assert topic.x == Apply("mul", (Constant(2), Name("V3")))
    assert (topic.y, topic.z) == (Constant(-1), Name("V3"))


def test_what_a_child_is_told_follows_from_its_constraints(tmp_path: Path) -> None:
    files = {
        **TEAM,
        "Robot1.xml": TEAM["Robot1.xml"].replace('<agent name="Robot3" variable="V1 W1"/>', '<agent name="Robot3"/>'),
    }
    write_files(tmp_path, files)
    assert read_robot(tmp_path / "Robot1.xml").children[1].variables == ()
    assert read_team(tmp_path)["Robot1"].children[1].variables == ("V1", "W1")


def test_order_of_elements_is_free_and_comments_are_read_over(tmp_path: Path) -> None:
    tree = etree.fromstring(TEAM["Robot2.xml"].encode())
    tree[:] = reversed(tree)
    shuffled = (
        etree.tostring(tree)
        .replace(b"<domains", b"<?pi x?><!-- <!DOCTYPE y> --><domains")
        .replace(b"1..4", b"1..<!-- -->4")
    )
    write_files(tmp_path, TEAM)
    straight = read_robot(tmp_path / "Robot2.xml")
    (tmp_path / "Robot2.xml").write_bytes(shuffled)
    assert read_robot(tmp_path / "Robot2.xml") == straight


def test_a_byte_order_mark_is_read_over(tmp_path: Path) -> None:
    (tmp_path / "Robot3.1.xml").write_bytes(b"\xef\xbb\xbf" + FIGURE_2.read_bytes())
    assert read_robot(tmp_path / "Robot3.1.xml") == read_robot(FIGURE_2)


def test_a_large_file_without_a_mistake(tmp_path: Path) -> None:
    row = '<constraint name="C0" reference="lt" scope="V1 W1"/>'
    written = (
        TEAM["Robot1.xml"]
        .replace(row, row * 2000)
        .replace(
            '<constraints nbConstraints="1">\n    <constraint name="C0"', '<constraints>\n    <constraint name="C0"'
        )
    )
    write_files(tmp_path, {"Robot1.xml": written})
    assert len(read_robot(tmp_path / "Robot1.xml").private) == 2000


def test_alone_in_the_world(tmp_path: Path) -> None:
    alone = Robot("Robot1", (Variable("V1", Domain("D1", (range(3),))),))
    (tmp_path / "Robot1.xml").write_bytes(robot_xml(alone))
    assert read_team(tmp_path).robots == (alone,)


def test_teams_are_found_in_natural_order(tmp_path: Path) -> None:
    for name in ["b10", "b9", "a/deep/er", ".hidden", "b9/late", "empty"]:
        (tmp_path / name).mkdir(parents=True)
    for name in ["b10", "b9", "a/deep/er", ".hidden", "b9/late"]:
        (tmp_path / name / "Robot1.xml").touch()
    (tmp_path / "link").symlink_to(tmp_path / "b9")
    assert find_teams(tmp_path) == [tmp_path / "a" / "deep" / "er", tmp_path / "b9", tmp_path / "b10"]
    assert find_teams(str(tmp_path / "link")) == [tmp_path / "link"]


def test_a_diagnostic_is_one_line_whatever_the_names() -> None:
    assert str(Diagnostic("a.xml", 3, "wrong", "mend it")) == "a.xml:3: wrong (mend it)"
    assert str(Diagnostic("a.xml", 0, "wrong", "mend it")) == "a.xml: wrong (mend it)"
    assert str(Diagnostic("a\n\x1b[2J\udcff.xml", 0, "wrong", "mend it")) == "a\\n\\x1b[2J\\udcff.xml: wrong (mend it)"


# --- what is written is read back ---------------------------------------------------------------------------------


@examples(60, slow=2000, also_suppress=(HealthCheck.function_scoped_fixture,))
@given(robot=random_robots())
def test_what_is_written_is_read_back(tmp_path: Path, robot: Robot) -> None:
    file = tmp_path / "Robot1.xml"
    file.write_bytes(robot_xml(robot))
    assert read_robot(file) == robot


def test_two_domains_of_one_name_are_told_apart_in_the_file(tmp_path: Path) -> None:
    values = (Variable("V1", Domain("D1", (range(3),))), Variable("V2", Domain("D1", (range(4),))))
    (tmp_path / "Robot1.xml").write_bytes(robot_xml(Robot("Robot1", values)))
    again = read_robot(tmp_path / "Robot1.xml").variables
    assert [(one.domain.name, list(one.domain)) for one in again] == [("D1", [0, 1, 2]), ("D1.2", [0, 1, 2, 3])]


def test_what_cannot_be_written_is_refused() -> None:
    values = (Variable("V1", Domain("D1", (range(3),))),)
    soft = Relation("R", 1, Semantics.SOFT, ((1,),), (0.5,), 0)
    with pytest.raises(ValueError, match="not an integer"):
        robot_xml(Robot("Robot1", values, private=(Constraint("C", soft, ("V1",), ("V1",), None),)))


# --- speed --------------------------------------------------------------------------------------------------------


def test_a_large_team_is_read_in_as_many_steps_for_each_constraint_as_a_small_one(tmp_path: Path) -> None:
    values, reach = Domain("D1", (range(1, 12),)), 10

    def steps(robots: int) -> float:
        """Read a team whose robots are linked with those before and behind them, and differ from them."""
        folder = tmp_path / str(robots)
        folder.mkdir()
        for number in range(robots):
            own = f"V{number}"
            above = [f"V{other}" for other in range(max(0, number - reach), number)]
            robot = Robot(
                f"Robot{number}",
                (Variable(own, values),),
                parents=tuple(
                    Parent(f"Robot{one[1:]}", (Constraint("C5", PREDEFINED["neq"], (one, own), (one, own)),))
                    for one in above
                ),
                children=tuple(
                    Child(f"Robot{other}", (own,)) for other in range(number + 1, min(robots, number + reach + 1))
                ),
            )
            (folder / f"Robot{number}.xml").write_bytes(robot_xml(robot))
        found = steps_of(lambda: teams.append(read_team(folder)))
        assert teams[-1].order == tuple(f"Robot{number}" for number in range(robots))
        return found / len(list(teams[-1].constraints()))

    teams: list[Team] = []
    assert steps(80) < 1.1 * steps(20)


# --- files --------------------------------------------------------------------------------------------------------


def test_files_are_written_whole(tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    write_atomically(target, b"one")
    write_atomically(target, b"two")
    assert target.read_bytes() == b"two"
    assert target.stat().st_mode & 0o400
    assert list(tmp_path.iterdir()) == [target]


def test_a_link_is_followed_and_a_device_is_written_to(tmp_path: Path) -> None:
    target, link = tmp_path / "a.json", tmp_path / "link"
    link.symlink_to(target)
    write_atomically(link, b"one")
    assert link.is_symlink()
    assert target.read_bytes() == b"one"
    write_atomically(Path(os.devnull), b"one")
    assert not Path(os.devnull).is_file()


@pytest.mark.parametrize("unnamed", [True, False])
def test_a_failure_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, unnamed: bool) -> None:
    if not unnamed:
        monkeypatch.delattr(os, "O_TMPFILE", raising=False)
    target = tmp_path / "a.json"
    write_atomically(target, b"old")

    def fails(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", fails)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(target, b"new")
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]
    with pytest.raises(FileNotFoundError):
        write_atomically(tmp_path / "nowhere" / "a.json", b"new")


@pytest.mark.skipif(not hasattr(os, "O_TMPFILE"), reason="Linux can write files without a name")
def test_a_killed_writer_leaves_no_half_file(tmp_path: Path) -> None:
    program = (
        "import sys, pathlib; from robochoc.formats import write_atomically\n"
        "print('ready', flush=True)\n"
        "while True: write_atomically(pathlib.Path(sys.argv[1]), b'x' * 50_000_000)"
    )
    target = tmp_path / "a.bin"
    with subprocess.Popen([sys.executable, "-c", program, str(target)], stdout=subprocess.PIPE) as writer:
        assert writer.stdout
        writer.stdout.readline()
        time.sleep(0.05)
        writer.send_signal(signal.SIGKILL)
        writer.wait()
    assert {path.stat().st_size for path in tmp_path.iterdir()} <= {50_000_000}


def test_one_mistake_of_two_files_is_told_once(tmp_path: Path) -> None:
    write_files(tmp_path, {**TEAM, "Robot2.xml": TEAM["Robot2.xml"].replace("</instance>", "")})
    with pytest.raises(InvalidInputError) as caught:
        read_team(tmp_path)
    assert len(caught.value.diagnostics) == 1
