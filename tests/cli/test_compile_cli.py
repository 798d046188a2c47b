"""`robochoc compile`, and what `solve` and `export` make of complex robots."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import pytest
from lxml import etree

from robochoc import Model
from robochoc.formats import PREDEFINED, read_team, write_team
from robochoc.model.problem import Constraint
from robochoc.verification.checker import violations
from tests.support.ace_stable import AceStable
from tests.support.complex_problems import complex_team
from tests.support.program import ROOT, robochoc_within

SMALL_QUEENS = ROOT / "instances" / "queens3d-4"
QUEENS = ROOT / "instances" / "queens3d-7"
REPORT_KEYS = {"team", "seconds", "robots"}
ROBOT_KEYS = {
    "robot", "variables", "interface", "private_constraints", "local_solutions", "groups", "seconds", "source",
}  # fmt: skip
LIMITS = {
    "known solutions": (["--local-solutions", 10], "--local-solutions"),
    "solutions": (["--local-solutions", 10, "--no-cache"], "--local-solutions"),
    "time": (["--ace", "--local-timeout", 0.001, "--no-cache"], "--local-timeout"),
}


@pytest.fixture(scope="module", autouse=True)
def one_solver(ace_stable: AceStable) -> Iterator[None]:
    with ace_stable.lent():
        yield


@pytest.fixture(scope="module")
def teams(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder for teams, and a cache for the tests of this file alone."""
    folder = tmp_path_factory.mktemp("teams")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield folder


def generated(teams: Path, n: int, *words: str) -> tuple[Path, str]:
    """The queens of n rows, and what `compile WORDS` prints of them the first time."""
    folder = teams / f"rows-{n}"
    assert robochoc_within("generate", "queens3d", "--n", n, "--robots", "rows", "-o", folder).returncode == 0
    done = robochoc_within("compile", *words, folder)
    assert (done.returncode, done.stderr) == (0, "")
    return folder, done.stdout


@pytest.fixture(scope="module")
def four_rows(teams: Path) -> tuple[Path, str]:
    return generated(teams, 4)


@pytest.fixture(scope="module")
def seven_rows(teams: Path) -> tuple[Path, str]:
    return generated(teams, 7, "--ace")


@pytest.fixture
def rows(seven_rows: tuple[Path, str]) -> Path:
    """Seven queens of seven drones each, which the cache knows."""
    return seven_rows[0]


@pytest.fixture(scope="module")
def torn(teams: Path) -> Path:
    """A team of which the second robot has no local solution."""
    wishes = [
        Constraint("C", PREDEFINED[name], scope, scope)
        for name, scope in (("lt", ("B1", "B2")), ("gt", ("B1", "B2")), ("neq", ("A", "B1")), ("neq", ("B2", "Z")))
    ]
    team = complex_team(
        {"Ann": ["A"], "Bob": ["B1", "B2"], "Zoe": ["Z"]}, dict.fromkeys(("A", "B1", "B2", "Z"), (1, 2, 3)), wishes
    )
    write_team(team, teams / "torn")
    return teams / "torn"


@pytest.fixture
def no_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever asks ACE, or enumerates instead, fails."""

    def asked(*_: object, **__: object) -> NoReturn:
        raise AssertionError("a solver was asked")

    monkeypatch.setattr("robochoc.solver.ace.AceProcess.submit", asked)


def answered(*words: object, status: int = 0) -> dict[str, Any]:
    """The one JSON object that the program prints."""
    done = robochoc_within(*words, "--json")
    assert done.returncode == status, done.stderr
    (line,) = done.stdout.splitlines()
    answer: dict[str, Any] = json.loads(line)
    return answer


def cells(table: str) -> list[list[str]]:
    """The cells of the rows that tell of robots, without times."""
    lines = [re.sub(r" [\d,.]+ ms ", "  ", line).strip() for line in table.splitlines()]
    return [re.split(r"\s{2,}", line) for line in lines if line.startswith("Robot")]


# The table


def test_a_table_tells_what_robots_come_to(four_rows: tuple[Path, str], seven_rows: tuple[Path, str]) -> None:
    for n, solutions, how, (folder, table) in ((4, 2, "enumerated", four_rows), (7, 40, "ACE", seven_rows)):
        numbers = [str(number) for number in (n, n, n * (n - 1) // 2, solutions, solutions)]
        first, *others = cells(table)
        assert first == ["Robot1", *numbers, how]
        assert others == [[f"Robot{row}", *numbers, "equal"] for row in range(2, n + 1)]
        assert table.splitlines()[0].strip() == folder.name
        assert len(table.splitlines()) == n + 3
        assert re.fullmatch(rf"{n} robots, [\d.]+ s; next: robochoc solve {folder}", table.splitlines()[-1])


@pytest.mark.usefixtures("no_solver")
def test_the_second_time_nothing_is_solved(rows: Path) -> None:
    done = robochoc_within("compile", rows)
    assert (done.returncode, done.stderr) == (0, "")
    assert [found[-1] for found in cells(done.stdout)] == ["cached"] + ["equal"] * 6


def test_json_tells_the_same(rows: Path) -> None:
    report = answered("compile", rows)
    assert report.keys() == REPORT_KEYS
    assert report["team"] == rows.name
    assert all(robot.keys() == ROBOT_KEYS for robot in report["robots"])
    assert sum(robot["seconds"] for robot in report["robots"]) <= report["seconds"]
    robots = [{key: robot[key] for key in ROBOT_KEYS - {"seconds"}} for robot in report["robots"]]
    assert robots == [
        {
            "robot": f"Robot{row}",
            "variables": 7,
            "interface": 7,
            "private_constraints": 21,
            "local_solutions": 40,
            "groups": 40,
            "source": "equal" if row > 1 else "cache",
        }
        for row in range(1, 8)
    ]


@pytest.mark.usefixtures("no_solver")
def test_robots_without_private_constraints_need_no_solver() -> None:
    report = answered("compile", "--no-cache", SMALL_QUEENS)
    assert [robot["source"] for robot in report["robots"]] == ["direct"] * 16
    assert {robot["local_solutions"] for robot in report["robots"]} == {4}


def test_a_terminal_shows_which_robot_is_compiled(rows: Path) -> None:
    shown = robochoc_within("compile", rows, terminal=True).stderr
    assert re.search(r"compiling \S+ \(1 of \d+\)", shown), shown


def test_compile_names_the_robot_without_local_solution(torn: Path) -> None:
    done = robochoc_within("compile", torn)
    assert (done.returncode, done.stderr) == (0, "")
    assert "without local solutions: Bob; so the team has no solution" in done.stdout
    by_name = {robot["robot"]: robot for robot in answered("compile", torn)["robots"]}
    assert [by_name[name]["local_solutions"] for name in ("Ann", "Bob", "Zoe")] == [3, 0, 3]


# Limits


@pytest.mark.parametrize("limit", LIMITS)
def test_compile_says_which_limit_a_robot_has_reached(rows: Path, limit: str) -> None:
    words, option = LIMITS[limit]
    done = robochoc_within("compile", *words, rows)
    assert done.returncode == 3
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"{rows}: Robot1")
    assert line.endswith("(and 6 more: Robot2, Robot3, Robot4, Robot5, Robot6, Robot7)")
    assert option in line
    assert [found[-1] for found in cells(done.stdout)] == ["limit reached"] * 7
    robots = answered("compile", *words, rows, status=3)["robots"]
    assert all(robot["local_solutions"] is None and option in robot["reason"] for robot in robots)


@pytest.mark.parametrize("limit", ["known solutions", "time"])
def test_solve_does_not_know_when_a_limit_is_reached(rows: Path, limit: str) -> None:
    words, option = LIMITS[limit]
    answer = answered("solve", *words, rows, status=3)
    assert (answer["verdict"], answer["assignment"], answer["verified"]) == ("unknown", {}, False)
    assert answer["reason"].startswith("Robot1")
    assert option in answer["reason"]


def test_solve_says_in_words_which_limit_was_reached(rows: Path) -> None:
    done = robochoc_within("solve", "--local-solutions", 39, rows)
    assert done.returncode == 3
    assert re.search(r"unknown: Robot1 has more than 39 .*--local-solutions", done.stdout)
    assert robochoc_within("compile", "--local-solutions", 40, rows).returncode == 0


def test_limits_that_are_none_are_wrong_usage() -> None:
    for words in ("--local-solutions=0", "--local-timeout=0", "--local-timeout=nan", "--local-timeout=-1"):
        assert robochoc_within("compile", words, SMALL_QUEENS).returncode == 2, words


# Verdicts


def test_a_robot_without_local_solution_ends_the_matter(torn: Path) -> None:
    done = robochoc_within("solve", torn)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.search(r"no solution \(Bob ", done.stdout)
    answer = answered("solve", torn)
    assert (answer["verdict"], answer["verified"]) == ("no-solution", False)
    assert answer["reason"].startswith("Bob ")
    assert answer["metrics"]["messages"] == 0


def test_others_are_placed_when_a_robot_without_local_solution_steps_aside(torn: Path) -> None:
    answer = answered("solve", "--withdraw", torn)
    assert (answer["verdict"], answer["withdrawn"], answer["verified"]) == ("optimal", ["Bob"], True)
    assert answer["assignment"].keys() == {"A", "Z"}


def test_the_judge_confirms_that_there_is_no_solution(torn: Path, four_rows: tuple[Path, str]) -> None:
    for folder in (torn, SMALL_QUEENS, four_rows[0]):
        answer = answered("solve", "--verify", folder)
        assert (answer["verdict"], answer["verified"]) == ("no-solution", True), folder
    assert "confirmed centrally" in robochoc_within("solve", "--verify", torn).stdout


def test_the_central_judge_places_everybody() -> None:
    answer = answered("solve", "--protocol", "central", QUEENS)
    assert (answer["verdict"], answer["verified"]) == ("solution", True)
    team = read_team(QUEENS)
    assert answer["assignment"].keys() == set(team.variables)
    assert not list(violations(team, answer["assignment"]))


def test_the_central_judge_counts() -> None:
    answer = answered("solve", "--protocol", "central", "--count", QUEENS)
    assert (answer["verdict"], answer["count"], answer["assignment"]) == ("solution", 56, {})


def test_the_central_judge_counts_no_solution(torn: Path) -> None:
    answer = answered("solve", "--protocol", "central", "--count", torn)
    assert (answer["verdict"], answer["count"]) == ("no-solution", 0)


def test_rows_have_the_solutions_that_cells_have(rows: Path) -> None:
    assert answered("solve", "--protocol", "central", "--count", rows)["count"] == 56
    answer = answered("solve", rows)
    assert (answer["verdict"], answer["verified"]) == ("solution", True)
    assert not list(violations(read_team(QUEENS), answer["assignment"]))


# Export, and what is broken


def test_export_writes_who_owns_what(four_rows: tuple[Path, str], tmp_path: Path) -> None:
    done = robochoc_within("export", four_rows[0])
    assert (done.returncode, done.stderr) == (0, "")
    root = etree.fromstring(done.stdout.encode())
    assert (root.get("format"), root.get("type")) == ("XCSP3", "CSP")
    notes = {element.get("id"): element.get("note") for element in root.iterfind("variables/var")}
    numbers = range(1, 5)
    assert notes == {f"V{row}_{column}": f"V{row}.{column} of Robot{row}" for row in numbers for column in numbers}
    assert len(root.findall("constraints//extension")) > 0
    written = tmp_path / "rows.xml"
    assert robochoc_within("export", four_rows[0], "-o", written).returncode == 0
    assert written.read_text() == done.stdout


def test_export_names_constraints_with_a_meaning_for_absent_robots(tmp_path: Path) -> None:
    model = Model("absent")
    one, two = (model.robot(name).variable("x", [1, 2]) for name in "ab")
    model.add(one != two, name="apart", when_absent="fail")
    model.add(one <= two, name="sorted", when_absent="drop")
    model.save(tmp_path / "absent")
    done = robochoc_within("export", tmp_path / "absent")
    assert (done.returncode, done.stderr.count("left out: when_absent of apart and 1 other constraint:")) == (0, 1)


def test_a_broken_file_is_named_with_its_line(rows: Path, tmp_path: Path) -> None:
    shutil.copytree(rows, tmp_path / "broken")
    broken = tmp_path / "broken" / "Robot3.xml"
    lines = broken.read_text().splitlines()
    broken.write_text("\n".join([*lines[:4], "<<", *lines[4:]]))
    done = robochoc_within("compile", tmp_path / "broken")
    assert (done.returncode, done.stdout) == (1, "")
    assert re.match(rf"{re.escape(str(broken))}:5:", done.stderr)


def test_teams_beside_a_broken_one_are_compiled_all_the_same(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        shutil.copytree(SMALL_QUEENS, tmp_path / name)
    (tmp_path / "b" / "Robot1.1.xml").write_text("<x")
    done = robochoc_within("compile", "--json", tmp_path)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert re.findall(r'"team":"(\w+)"', done.stdout) == ["a", "c"]
